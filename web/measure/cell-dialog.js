// The cell in three fields, for a new session or to correct one; the rest stands under "more".

import { api } from "../state/api.js";
import { Problem } from "../state/http.js";
import { field, h, make } from "../dom.js";
import { inField, typedNumber, when } from "../format.js";
import { go } from "../router.js";
import { conventions } from "../state/registries.js";
import { maybe, t } from "../texts.js";
import { did, patchBack } from "../state/undo.js";
import { bring } from "../state/upload.js";
import { ChainPictureElement, turntableBox } from "./chain-picture.js";
import { conventionWords } from "./pose-columns.js";
import { alarm, closeButton, once, showDialog } from "../components/dialog.js";
import { attempt } from "../components/toasts.js";

/** @import {Cell} from "../api-types.js" */
/** @import {Found} from "../state/files.js" */
/** @import {ConventionInfo, Kind, PoseConvention, SessionBody, SessionOut} from "../state/model.js" */

/** Captures that come every moment change the session as well. */
const MOST_TURNS = 8;
/** @type {readonly Kind[]} */
const KINDS = ["profile", "cloud", "center", "frame"];
/** @type {readonly NonNullable<Cell["board"]>["kind"][]} */
const BOARDS = ["chessboard", "charuco", "circles", "asymmetric-circles"];

/** @param {string} name @param {Record<string, unknown>} [rest] */
function number(name, rest = {}) {
  return h("input", { name, type: "text", inputmode: "decimal", autocomplete: "off", ...rest });
}

function kindField() {
  return h("select", { name: "kind" }, ...KINDS.map((kind) => h("option", { value: kind }, t(/** @type {"kind.profile"} */ (`kind.${kind}`)))));
}

/** @param {ConventionInfo[]} conventions */
function brandField(conventions) {
  const options = conventions.map((one) => ({ value: one.name, words: conventionWords(one) })).sort((a, b) => a.words.localeCompare(b.words));
  return h("select", { name: "convention", required: true }, h("option", { value: "" }, t("choose")), ...options.map(({ value, words }) => h("option", { value }, words)));
}

/** The board's fields; needed only where raw camera frames come in. */
function boardFields() {
  return h("details", {}, h("summary", {}, t("new.board")), h("div", { class: "more-fields" },
    field("new-board-kind", t("new.board_kind"), h("select", { name: "board_kind" }, ...BOARDS.map((kind) => h("option", { value: kind }, t(`board.${kind}`))))),
    field("new-board-columns", t("new.board_columns"), number("board_columns"), t("new.board_hint")),
    field("new-board-rows", t("new.board_rows"), number("board_rows")),
    field("new-board-pitch", t("new.board_pitch"), number("board_pitch")),
    field("new-board-pitch-y", t("new.board_pitch_y"), number("board_pitch_y"), t("new.board_pitch_hint")),
    field("new-board-pitch-sigma", t("new.board_pitch_sigma"), number("board_pitch_sigma")),
    field("new-board-marker", t("new.board_marker"), number("board_marker")),
    field("new-board-dictionary", t("new.board_dictionary"), h("input", { name: "board_dictionary", type: "text", autocomplete: "off" }), t("new.board_dictionary_hint")),
    h("button", { type: "button", class: "plain wide", id: "new-board-print", onclick: printBoard }, t("new.board_print")),
    h("button", { type: "button", class: "plain wide", id: "new-board-svg", value: "svg", onclick: printBoard }, t("new.board_svg"))));
}

/** Save the board that the form describes as a page to print, in the form the button names; what it lacks is marked. @param {Event} event */
function printBoard({ currentTarget }) {
  const { form, value } = /** @type {HTMLButtonElement} */ (currentTarget);
  if (!form) return;
  const data = new FormData(form);
  mark(form, Object.fromEntries(Object.entries(faults(data)).filter(([name]) => name.startsWith("board_"))));
  const board = boardOf(data);
  if (board) h("a", { href: api.boardAddress({ ...board, form: value || undefined }), download: "" }).click();
  else mark(form, { board_columns: t("new.need_board") });
}

/** @param {FormData} form */
function markersOf(form) {
  const dictionary = String(form.get("board_dictionary") ?? "").trim();
  return { marker_mm: typed(form, "board_marker"), dictionary: dictionary || undefined };
}

/** @param {FormData} form */
function boardOf(form) {
  const [columns, rows, pitch_mm] = ["board_columns", "board_rows", "board_pitch"].map((name) => typed(form, name));
  const kind = BOARDS.find((one) => one === form.get("board_kind"));
  if (!kind || !columns || !rows || !pitch_mm) return undefined;
  const measured = { pitch_mm, pitch_y_mm: typed(form, "board_pitch_y"), pitch_sigma_mm: typed(form, "board_pitch_sigma") };
  return { kind, columns, rows, ...measured, ...(kind === "charuco" ? markersOf(form) : {}) };
}

/**
 * A number as people type it, with a decimal comma too; `undefined` where nothing was typed.
 * @param {FormData} form
 * @param {string} name
 */
function typed(form, name) {
  const text = String(form.get(name) ?? "").trim();
  return text === "" ? undefined : typedNumber(text);
}

/** @param {FormData} form @returns {SessionBody} */
function bodyOf(form) {
  const convention = String(form.get("convention"));
  const z = form.get("z_axis");
  return {
    name: String(form.get("name") ?? "").trim() || t("new.default_name", { robot: maybe(`convention.${convention}`, convention), date: when(new Date().toISOString()) }),
    cell: {
      pose_convention: /** @type {PoseConvention} */ (form.get("convention")),
      sphere_diameter_mm: typed(form, "diameter"),
      sphere_diameter_sigma_mm: typed(form, "diameter_sigma"),
      scanner: { kind: /** @type {Kind} */ (form.get("kind")), point_sigma_mm: typed(form, "point_sigma"), z_axis: z === "away" || z === "toward" ? z : undefined },
      board: boardOf(form),
      turntable: form.get("turntable") ? {} : undefined,
      robot: { position_sigma_mm: typed(form, "position_sigma"), orientation_sigma_deg: typed(form, "orientation_sigma"), arm: form.get("arm") ? JSON.parse(String(form.get("arm"))) : undefined, errors: form.get("arm_errors") === "apply" ? "apply" : undefined },
    },
  };
}

/** Fields that a first look finds at fault: name and sentence. @param {FormData} form */
function faults(form) {
  /** @type {Record<string, string>} */
  const found = {};
  if (!form.get("convention")) found["convention"] = t("new.need_convention");
  const diameter = typed(form, "diameter");
  if (diameter === undefined && form.get("kind") === "profile") found["diameter"] = t("new.need_diameter");
  for (const name of ["diameter", "diameter_sigma", "point_sigma", "position_sigma", "orientation_sigma", "board_columns", "board_rows", "board_pitch", "board_pitch_y", "board_pitch_sigma", "board_marker"]) {
    const value = typed(form, name);
    if (value !== undefined && !(value > 0 || (value === 0 && name.endsWith("_sigma") && name !== "point_sigma"))) found[name] = t("new.need_number");
  }
  const board = ["board_columns", "board_rows", "board_pitch"];
  const lacking = board.filter((name) => typed(form, name) === undefined);
  if (lacking[0] && (form.get("kind") === "frame" || lacking.length < board.length)) found[lacking[0]] = t("new.need_board");
  if (!lacking[0] && form.get("board_kind") === "charuco") {
    const { marker_mm, dictionary } = markersOf(form);
    if (!dictionary) found["board_dictionary"] = t("new.need_markers");
    if (!marker_mm || marker_mm >= (typed(form, "board_pitch") ?? 0)) found["board_marker"] = t("new.need_markers");
  }
  if (diameter !== undefined && diameter > 0 && diameter < 1) found["diameter"] = t("new.metres", { diameter, millimetres: Number((diameter * 1000).toPrecision(9)) });
  return found;
}

/** @param {Pick<SessionOut, "cell">} [session] */
const hasTable = (session) => session?.cell.turntable !== undefined && session.cell.turntable !== null;

/**
 * Fill the form with what is known.
 * @param {HTMLFormElement} form
 * @param {SessionOut} session
 */
function fill(form, { name, cell, captures }) {
  /** @type {Record<string, unknown>} */
  const values = {
    name, kind: cell.scanner?.kind ?? captures?.find(({ step }) => step === "tcp")?.kind ?? "profile", convention: cell.pose_convention, diameter: cell.sphere_diameter_mm,
    diameter_sigma: cell.sphere_diameter_sigma_mm, point_sigma: cell.scanner?.point_sigma_mm, z_axis: cell.scanner?.z_axis,
    board_kind: cell.board?.kind ?? "chessboard", board_columns: cell.board?.columns, board_rows: cell.board?.rows, board_pitch: cell.board?.pitch_mm,
    board_pitch_y: cell.board?.pitch_y_mm, board_pitch_sigma: cell.board?.pitch_sigma_mm,
    board_marker: cell.board?.marker_mm, board_dictionary: cell.board?.dictionary,
    position_sigma: cell.robot?.position_sigma_mm, orientation_sigma: cell.robot?.orientation_sigma_deg,
    arm: cell.robot?.arm ? JSON.stringify(cell.robot.arm) : "", arm_errors: cell.robot?.errors === "apply" ? "apply" : "",
  };
  for (const [key, value] of Object.entries(values)) {
    const control = form.elements.namedItem(key);
    if (control instanceof HTMLInputElement || control instanceof HTMLSelectElement) control.value = String(inField(value));
  }
}

/**
 * As a change of a session: what was emptied is taken away.
 * @param {SessionBody} body
 */
function asChange(body) {
  // Lists are replaced as a whole: what is left out in them needs no null.
  return JSON.parse(JSON.stringify(body, (_, value) => (value === undefined ? null : Array.isArray(value) ? JSON.parse(JSON.stringify(value)) : value)));
}

/** @param {SessionOut} [session] the one to correct; a new one otherwise */
export const cellDialog = (session) => attempt(async () => open(await conventions(), session));

/** A new session for files that are there already, and what they tell of the cell. @param {PoseConvention | undefined} convention @param {Found[]} found @param {number} [diameter_mm] */
export const cellDialogFor = (convention, found, diameter_mm) => attempt(async () => open(await conventions(), undefined, { convention, found, diameter_mm }));

/** @param {ConventionInfo[]} conventions @param {SessionOut} [session] @param {{ convention: PoseConvention | undefined, found: Found[], diameter_mm?: number | undefined }} [brought] */
function open(conventions, session, brought) {
  const told = alarm();
  const chain = make(ChainPictureElement, { cell: session?.cell ?? {}, turntable: hasTable(session) }), table = turntableBox(chain, "new-turntable", t("new.turntable"));
  const form = h(
    "form", { method: "dialog", novalidate: true },
    h("h2", { id: "new-title" }, t(session ? "cell.correct" : "new.title")),
    field("new-kind", t("new.kind"), kindField()),
    field("new-convention", t("new.brand"), brandField(conventions), t("new.brand_hint")),
    field("new-diameter", t("new.diameter"), number("diameter"), t("new.diameter_hint")),
    boardFields(),
    h("details", { open: !!(session?.cell.scanners || session?.cell.axes || session?.cell.spheres) }, h("summary", {}, t("chain.title")), chain),
    h("details", {}, h("summary", {}, t("menu.open")), h("div", { class: "more-fields" },
      table.element,
      field("new-name", t("name"), h("input", { name: "name", maxlength: 200, autocomplete: "off" })),
      field("new-diameter-sigma", t("new.diameter_sigma"), number("diameter_sigma")),
      h("button", { type: "button", class: "plain wide", onclick: async (/** @type {Event} */ { target }) => (await import("../guidance/certificate.js")).fillFromCertificate(/** @type {HTMLButtonElement} */ (target).form) }, t("new.certificate")),
      field("new-point-sigma", t("new.point_sigma"), number("point_sigma")),
      h("input", { type: "hidden", name: "sphere" }),
      h("input", { type: "hidden", name: "arm" }),
      h("button", { type: "button", class: "plain wide", id: "new-arm", onclick: async (/** @type {Event} */ { currentTarget }) => (await import("../guidance/arm.js")).chooseArm(/** @type {HTMLButtonElement} */ (currentTarget)) }, t("new.arm")),
      field("new-arm-errors", t("new.arm_errors"), h("select", { name: "arm_errors" }, h("option", { value: "" }, t("new.arm_cover")), h("option", { value: "apply" }, t("new.arm_apply"))), t("new.arm_errors_hint")),
      field("new-position-sigma", t("new.position_sigma"), number("position_sigma")),
      field("new-orientation-sigma", t("new.orientation_sigma"), number("orientation_sigma")),
      field("new-z", t("new.z_axis"), h("select", { name: "z_axis" }, h("option", { value: "" }, t("new.z_data")), h("option", { value: "away" }, t("new.z_away")), h("option", { value: "toward" }, t("new.z_toward")))),
      h("p", { class: "hint soft small" }, t("new.sigma_hint")))),
    h("div", { class: "foot" }, told.element,
      h("div", { class: "row end" }, closeButton(), h("button", { type: "submit", class: "primary" }, t(session ? "place.save" : "new.go")))),
  );
  const dialog = h("dialog", { "aria-labelledby": "new-title" }, form);
  const base = { session, found: brought?.found };
  const convention = form.elements.namedItem("convention");
  if (brought?.convention && convention instanceof HTMLSelectElement) convention.value = brought.convention;
  const diameter = form.elements.namedItem("diameter");
  if (brought?.diameter_mm && diameter instanceof HTMLInputElement) diameter.value = String(inField(brought.diameter_mm));
  form.addEventListener("submit", once(() => submit(form, chain, told, dialog, base)));
  if (session) fill(form, session);
  showDialog(dialog);
}

/**
 * Change a session as it was when the dialog opened. Captures may come meanwhile; where somebody else has changed name or
 * cell, that is told, and the next time this change takes its place.
 * @param {{ session?: SessionOut }} base
 * @param {SessionOut} before
 * @param {Record<string, unknown>} change
 * @returns {Promise<SessionOut>}
 */
async function changed(base, before, change) {
  for (let turn = 1; ; turn++) {
    const now = await api.session(before.id);
    const theirs = namesOfChanges({ name: before.name, ...before.cell }, { name: now.name, ...now.cell });
    if (theirs.length) {
      base.session = now;
      throw new Problem({ type: "about:blank", title: "", status: 412, detail: t("problem.outdated", { what: theirs.join(", ") }) });
    }
    try {
      return await api.changeSession(before.id, change, now.revision);
    } catch (error) {
      // Between the look and the change somebody was faster: look again.
      if (!(error instanceof Problem) || error.status !== 412 || turn === MOST_TURNS) throw error;
    }
  }
}

/** @param {Record<string, unknown>} before @param {Record<string, unknown>} after */
function namesOfChanges(before, after) {
  return [...new Set([...Object.keys(before), ...Object.keys(after)])].filter((name) => JSON.stringify(before[name] ?? null) !== JSON.stringify(after[name] ?? null));
}

/**
 * @param {HTMLFormElement} form
 * @param {ChainPictureElement} chain
 * @param {ReturnType<typeof alarm>} told
 * @param {HTMLDialogElement} dialog
 * @param {{ session?: SessionOut, found?: Found[] }} base the session as the fields were filled from it; without one a new one is made, for files that may be there already
 */
async function submit(form, chain, { show, during }, dialog, base) {
  const data = new FormData(form);
  const found = faults(data);
  mark(form, found);
  const [fault] = Object.values(found);
  show(fault ?? "");
  if (fault) return;
  await during(async () => {
    const body = bodyOf(data);
    body.cell = /** @type {Cell} */ ({ ...body.cell, ...chain.value, ...certified(data, base.session) });
    const stored = base.session ? await changed(base, base.session, asChange(body)) : await api.createSession(body);
    const { session } = base;
    dialog.close();
    if (session) {
      const set = (/** @type {SessionOut} */ to, /** @type {SessionOut} */ from) => api.changeSession(session.id, { name: to.name, cell: patchBack(to.cell, from.cell) });
      did(t("cell.changed"), () => set(session, stored), { redo: () => set(stored, session) });
    }
    else {
      if (base.found) bring(stored.id, base.found);
      go(`/sessions/${stored.id}`);
    }
  });
}

/** The sphere as its certificate names it, among what else the cell has. @param {FormData} data @param {SessionOut} [session] */
function certified(data, session) {
  const read = data.get("sphere");
  if (!read) return {};
  const known = session?.cell.equipment ?? [];
  const before = known.find(({ kind }) => kind === "sphere");
  return { equipment: [...known.filter((one) => one !== before), { ...before, ...JSON.parse(String(read)) }] };
}

/** @param {HTMLFormElement} form @param {Record<string, string>} found */
function mark(form, found) {
  let first = true;
  for (const control of form.querySelectorAll("input, select")) {
    const fault = found[control.getAttribute("name") ?? ""];
    control.closest(".field")?.toggleAttribute("data-invalid", fault !== undefined);
    if (fault) control.setAttribute("aria-invalid", "true");
    else control.removeAttribute("aria-invalid");
    if (!fault || !first) continue;
    first = false;
    const more = control.closest("details");
    if (more) more.open = true;
    /** @type {HTMLElement} */ (control).focus();
  }
}
