// What the page asks of the server, one entry for each request. Types come from the server's OpenAPI document (api-types.d.ts).

import { all, get, json, LOGIN, madeAgainst, Problem, request, ROOT, sendFile } from "./http.js";

/** @import {Equipment, RegisteredEquipment} from "../api-types.js" */
/** @import {CellDrift, CellSummary, Release, SessionAnswer, AppliedChanges, Changes, RootCauses, CodeOfFinding, OffTheTruth, CloudView, AuditEntry, CloudDeviations, CloudSection, KeptFile, MadeToken, TokenRequest, TokenRecord, ReferenceMesh, Capture, CaptureOut, ControllerFile, FileReading, RecognisedFiles, FolderState, Comparison, Guide, Job, Me, Moment, Page, PoseLines, PastResult, RecheckPlan, Recomputed, Results, SceneControls, SessionBody, SessionOut, SessionSummary, TimelineItem, ToolComparison} from "./model.js" */

/** @param {string} id */
export const session = (id) => `/sessions/${encodeURIComponent(id)}`;

/**
 * @param {string} id
 * @param {string} captureId
 */
const capture = (id, captureId) => `${session(id)}/captures/${encodeURIComponent(captureId)}`;

/** @param {readonly { path: string, file: File }[]} found @param {string} field */
function filesForm(found, field) {
  const form = new FormData();
  for (const { path, file } of found) form.append(field, file, path);
  return form;
}

/** A file's beginning tells what it is; smaller ones are sent whole, for their pictures and poses. */
const HEAD_BYTES = 65536;
/** Up to this size; less, where the server refuses all of it at once. */
const WHOLE_BYTES = [2e6, HEAD_BYTES, 4096];
const TOO_LARGE = 413;

/** @param {Record<string, string | number | readonly number[]>} values */
const query = (values) => new URLSearchParams(Object.entries(values).flatMap(([name, value]) => [value].flat().map((one) => [name, String(one)]))).toString();

/** What the merged cloud is compared with. @param {CloudView} view @returns {Record<string, string | number>} */
const compared = ({ against, diameter_mm }) => ({ against, ...(against === "sphere" && diameter_mm ? { diameter_mm } : {}) });

/** What the merged cloud is cut across. @param {CloudView} view @returns {Record<string, string | readonly number[]>} */
const cut = ({ axis, normal }) => (axis === "plane" ? { normal: normal ?? [] } : { axis });

export const api = {
  /** Who asks, and what they may. @returns {Promise<Me>} */
  me: () => get("/me"),

  /** @param {string} token @returns {Promise<Me>} */
  logIn: async (token) => (await request(LOGIN, json("POST", { token }))).json(),

  logOut: async () => void (await request("/logout", json("POST"))),

  /** What the server says that there is of one sort. @param {"stages" | "formats" | "conventions" | "exports" | "sources" | "brands"} sort @returns {Promise<any[]>} */
  registry: async (sort) => (await get(`/${sort}`)).items,

  /** What is said of a finding's code. @param {string} code @returns {Promise<CodeOfFinding>} */
  codeOfFinding: (code) => get(`/findings/${encodeURIComponent(code)}`),

  /** @returns {Promise<SessionSummary[]>} */
  sessions: () => all("/sessions"),

  /** @param {SessionBody} body @returns {Promise<SessionOut>} */
  createSession: async (body) => (await request("/sessions", json("POST", body))).json(),

  /** @param {File} file @param {(share: number) => void} progress @returns {Promise<SessionOut>} */
  importArchive: (file, progress) => sendFile("/archives", file, "application/zip", progress),

  /** @param {string} id @returns {Promise<SessionOut>} */
  session: (id) => get(session(id)),

  /** Refused with 412 where a `revision` is given and the session is no longer that one. @param {string} id @param {Record<string, unknown>} change @param {number} [revision] @returns {Promise<SessionOut>} */
  changeSession: async (id, change, revision) => (await request(session(id), madeAgainst(revision, json("PATCH", change)))).json(),

  /** @param {string} id @returns {Promise<RootCauses>} */
  causes: (id) => get(`${session(id)}/causes`),

  /** @param {string} id @param {string} cause @returns {Promise<AppliedChanges>} */
  applyCause: async (id, cause) => (await request(`${session(id)}/causes/${encodeURIComponent(cause)}/apply`, json("POST"))).json(),

  /** Change the cell and captures together, all or nothing. @param {string} id @param {Changes} changes @returns {Promise<AppliedChanges>} */
  changeTogether: async (id, changes) => (await request(`${session(id)}/changes`, json("POST", changes))).json(),

  /** @param {string} id */
  removeSession: async (id) => void (await request(session(id), json("DELETE"))),

  /** @param {string} id @returns {Promise<Guide>} */
  guide: (id) => get(`${session(id)}/guide`),

  /** The poses that a recheck captures again. @param {string} id @returns {Promise<RecheckPlan>} */
  recheckPlan: (id) => get(`${session(id)}/recheck`),

  /** @param {string} id @returns {Promise<Results>} */
  results: (id) => get(`${session(id)}/results`),

  /** @param {string} id @returns {Promise<CaptureOut[]>} */
  captures: (id) => all(`${session(id)}/captures`),

  /** @param {string} id @param {string} captureId @returns {Promise<CaptureOut>} */
  capture: (id, captureId) => get(capture(id, captureId)),

  /**
   * @param {string} id
   * @param {Capture} record
   * @param {File[]} files
   * @returns {Promise<CaptureOut>}
   */
  addCapture: async (id, record, files) => {
    const form = new FormData();
    form.append("record", JSON.stringify(record));
    files.forEach((file, index) => form.append("files", file, record.files?.[index] ?? file.name));
    return (await request(`${session(id)}/captures`, { method: "POST", body: form })).json();
  },

  /** @param {string} id @param {string} captureId @param {Record<string, unknown>} change @returns {Promise<CaptureOut>} */
  changeCapture: async (id, captureId, change) => (await request(capture(id, captureId), json("PATCH", change))).json(),

  /** @param {string} id @param {string} captureId @param {string} [why] */
  removeCapture: async (id, captureId, why = "") => void (await request(`${capture(id, captureId)}${why && `?why=${encodeURIComponent(why)}`}`, json("DELETE"))),

  /** @param {string} id @param {string} captureId @param {string} name @returns {Promise<File>} */
  captureFile: async (id, captureId, name) => {
    const short = name.split("/").at(-1) ?? name;
    const response = await request(`${capture(id, captureId)}/files/${encodeURIComponent(short)}`);
    return new File([await response.blob()], short);
  },

  /** The simulated cell goes to a capture's pose again. @param {string} id @param {string} captureId @returns {Promise<CaptureOut>} */
  captureAgain: async (id, captureId) => (await request(`${session(id)}/sources/simulated/capture?again=${encodeURIComponent(captureId)}`, json("POST"))).json(),

  /** One of `step` where the simulated cell has some left. @param {string} id @param {string} [step] @param {string} [why] @returns {Promise<CaptureOut>} */
  captureSimulated: async (id, step, why) => (await request(`${session(id)}/sources/simulated/capture?${query({ ...(step ? { step } : {}), ...(why ? { why } : {}) })}`, json("POST"))).json(),

  /** @param {string} id @param {string} text @param {string} [convention] the cell's where left out @returns {Promise<PoseLines>} */
  readPoseLines: async (id, text, convention) => (await request(`${session(id)}/pose-lines`, json("POST", { text, convention }))).json(),

  /** What stands in a controller's files; nothing is stored. @param {readonly { path: string, file: File }[]} found @param {string} [arm] whose joints are asked whose the poses are @returns {Promise<ControllerFile>} */
  readControllerFiles: async (found, arm) => {
    const form = filesForm(found, "files");
    if (arm) form.append("told", JSON.stringify({ arm }));
    return (await request("/controller-files", { method: "POST", body: form })).json();
  },

  /** What files are and how measurements and poses pair; nothing is stored. @param {readonly { path: string, file: File }[]} found @param {{ taken_for: Record<string, string>, convention?: string }} told @param {readonly number[]} [portions] @returns {Promise<RecognisedFiles>} */
  recogniseFiles: async (found, told, [whole = 0, ...less] = WHOLE_BYTES) => {
    const cut = found.filter(({ file }) => file.size > whole && !/\.(zip|urp|installation)$/i.test(file.name));
    const sizes = Object.fromEntries(cut.map(({ path, file }) => [path, file.size]));
    const form = filesForm(found.map(({ path, file }) => ({ path, file: path in sizes ? new File([file.slice(0, Math.min(whole, HEAD_BYTES))], file.name) : file })), "files");
    form.append("told", JSON.stringify({ ...told, sizes }));
    try {
      return await (await request("/recognised-files", { method: "POST", body: form })).json();
    } catch (error) {
      if (!(error instanceof Problem && error.status === TOO_LARGE && less.length)) throw error;
      return api.recogniseFiles(found, told, less);
    }
  },

  /** What a reader takes from a scanner's file; nothing is stored. @param {{ path: string, file: File }} found @param {string} kind @param {string} format @param {Record<string, unknown>} settings @returns {Promise<FileReading>} */
  readScannerFile: async (found, kind, format, settings) => {
    const form = filesForm([found], "file");
    for (const [name, value] of Object.entries({ kind, format, settings: JSON.stringify(settings) })) form.append(name, value);
    return (await request("/readings", { method: "POST", body: form })).json();
  },

  /** The file of a backup that holds the tool, with that one entry changed. @param {string} id @param {string} format @param {readonly { path: string, file: File }[]} backup @param {Record<string, unknown>} settings */
  exportInto: async (id, format, backup, settings) => {
    const form = filesForm(backup, "backup");
    form.append("settings", JSON.stringify(settings));
    const response = await request(`${session(id)}/exports/${encodeURIComponent(format)}`, { method: "POST", body: form });
    const name = decodeURIComponent(/filename\*=UTF-8''(.+)$/.exec(response.headers.get("Content-Disposition") ?? "")?.[1] ?? "backup");
    return { name, content: await response.blob() };
  },

  /** The answer in another program's syntax. @param {string} id @param {string} format @param {Record<string, unknown>} settings */
  exported: async (id, format, settings) => (await request(`${session(id)}/exports/${encodeURIComponent(format)}?${new URLSearchParams({ settings: JSON.stringify(settings) })}`)).blob(),

  /** The tool in the controller beside the answer. @param {string} id @param {readonly { path: string, file: File }[]} found none where numbers are sent @param {Record<string, string>} asked @returns {Promise<ToolComparison>} */
  readBack: async (id, found, asked) => {
    const form = filesForm(found, "files");
    for (const [name, value] of Object.entries(asked)) if (value) form.append(name, value);
    return (await request(`${session(id)}/read-back`, { method: "POST", body: form })).json();
  },

  /** Poses that are looked at before they are used, in the scene of who looks; none takes them away. @param {string} id @param {number[][][]} poses */
  tryPoses: (id, poses) => {
    // The scene is an extra: where it shows nothing, the numbers still do.
    void fetch(`/scenes/${encodeURIComponent(id)}/trial`, json("POST", { poses })).catch(() => undefined);
  },

  /** @param {string} id @returns {Promise<FolderState>} */
  folder: (id) => get(`${session(id)}/sources/folder`),

  /** @param {string} id @param {string} folder @param {string} step @returns {Promise<FolderState>} */
  watchFolder: async (id, folder, step) => (await request(`${session(id)}/sources/folder`, json("PUT", { folder, step }))).json(),

  /** @param {string} id */
  endWatching: async (id) => void (await request(`${session(id)}/sources/folder`, json("DELETE"))),

  /** @param {string} id @param {string} stage @returns {Promise<Job>} */
  solve: async (id, stage) => (await request(`${session(id)}/solve/${stage}`, json("POST"))).json(),

  /** @param {string} id @returns {Promise<Job | null>} */
  newestJob: async (id) => (await get(`/jobs?limit=1&session=${encodeURIComponent(id)}`)).items[0] ?? null,

  /** @param {string} jobId @returns {Promise<Job>} */
  job: (jobId) => get(`/jobs/${encodeURIComponent(jobId)}`),

  /** @param {string} jobId */
  cancelJob: async (jobId) => void (await request(`/jobs/${encodeURIComponent(jobId)}/cancel`, json("POST"))),

  /** What can be set in a scene. @param {string} scene its address @returns {Promise<SceneControls>} */
  sceneControls: async (scene) => (await request("controls", {}, scene)).json(),

  /** @param {string} scene its address @param {string} what @param {Record<string, unknown>} body */
  tellScene: async (scene, what, body) => void (await request(what, json("POST", body), scene)),

  /** Tell one page's scene the story of a step. @param {string} scene its address @param {string} viewer @param {string} step @param {"measure" | "result"} side @returns {Promise<{ open: boolean, view: string, layers: Record<string, boolean> }>} */
  sceneStory: async (scene, viewer, step, side) => (await request(`viewers/${viewer}/story`, json("POST", { step, side }), scene)).json(),

  /** What one page sees of a scene. @param {string} scene its address @param {string} viewer @param {number} width @param {number} height @returns {Promise<Blob>} */
  scenePicture: async (scene, viewer, width, height) => (await request(`viewers/${viewer}/picture?width=${width}&height=${height}`, {}, scene)).blob(),

  /** How a cell's answers moved over its sessions. @param {string} cell @returns {Promise<CellDrift>} */
  drift: (cell) => get(`/cells/${encodeURIComponent(cell)}/drift`),

  /** All cells, with what is in force for each. @returns {Promise<CellSummary[]>} */
  cells: async () => (await get("/cells")).items,

  /** What is in force for a cell, with what speaks against it now. @param {string} cell @returns {Promise<SessionAnswer>} */
  inForce: (cell) => get(`/cells/${encodeURIComponent(cell)}/answer`),

  /** Its releases, the newest first: that one is in force. @param {string} cell @returns {Promise<Release[]>} */
  releases: async (cell) => (await get(`/cells/${encodeURIComponent(cell)}/history`)).releases,

  /** The session's one answer that counts. @param {string} id @returns {Promise<SessionAnswer>} */
  answer: (id) => get(`${session(id)}/answer`),

  /** Put the session's answer in force for its cell. @param {string} id @param {string} why @param {readonly string[]} allow names of faults @returns {Promise<Release>} */
  release: async (id, why, allow) => (await request(`${session(id)}/release`, json("POST", { why, allow: allow.join(",") }))).json(),

  /** End a fault of the moment as it stands now. @param {string} cell @param {string} fault @param {string} why */
  acknowledge: async (cell, fault, why) => (await request(`/cells/${encodeURIComponent(cell)}/acknowledge`, json("POST", { fault, why }))).json(),

  /** @param {string} cell @param {number} number of the release that is put in force again @param {string} why @returns {Promise<Release>} */
  rollBack: async (cell, number, why) => (await request(`/cells/${encodeURIComponent(cell)}/rollback`, json("POST", { number, why }))).json(),

  /** How far a simulated cell's result lies from the truth. @param {string} id @param {string} stage @returns {Promise<OffTheTruth>} */
  truth: (id, stage) => get(`${session(id)}/truth/${encodeURIComponent(stage)}`),

  /** What happened, in order. @param {string} id @returns {Promise<TimelineItem[]>} */
  timeline: async (id) => (await get(`${session(id)}/timeline`)).items,

  /** The session as it stood then. @param {string} id @param {number} place @returns {Promise<Moment>} */
  moment: (id, place) => get(`${session(id)}/timeline/${place}`),

  /** All results that a stage ever had. @param {string} id @param {string} stage @returns {Promise<PastResult[]>} */
  history: async (id, stage) => (await get(`${session(id)}/results/${encodeURIComponent(stage)}/history`)).items,

  /** Each side is a session, or `session:number` of a result. @param {string} stage @param {string} left @param {string} right @returns {Promise<Comparison>} */
  compare: (stage, left, right) => get(`/compare/${encodeURIComponent(stage)}?${new URLSearchParams({ left, right })}`),

  /** Solve everything afresh to compare. @param {string} id @returns {Promise<Job>} */
  recompute: async (id) => (await request(`${session(id)}/replay`, json("POST"))).json(),

  /** @param {string} jobId @returns {Promise<Recomputed>} */
  jobAnswer: (jobId) => get(`/jobs/${encodeURIComponent(jobId)}/answer`),

  /** What came with the archive that a session was imported from. @param {string} id @returns {Promise<KeptFile[]>} */
  kept: async (id) => (await get(`${session(id)}/kept`)).items,

  /** @param {string} id @param {string} name */
  keptAddress: (id, name) => `${ROOT}${session(id)}/kept/${name.split("/").map(encodeURIComponent).join("/")}`,

  /** @returns {Promise<TokenRecord[]>} */
  tokens: async () => (await get("/tokens")).items,

  /** The answer alone holds the token itself. @param {TokenRequest} body @returns {Promise<MadeToken>} */
  makeToken: async (body) => (await request("/tokens", json("POST", body))).json(),

  /** @param {string} tokenId */
  revokeToken: async (tokenId) => void (await request(`/tokens/${encodeURIComponent(tokenId)}`, json("DELETE"))),

  /** The register. @returns {Promise<RegisteredEquipment[]>} */
  equipment: async () => (await get("/equipment")).items,

  /** @param {Equipment} piece @returns {Promise<RegisteredEquipment>} */
  addEquipment: async (piece) => (await request("/equipment", json("POST", piece))).json(),

  /** @param {string} id @param {Equipment} piece @returns {Promise<RegisteredEquipment>} */
  changeEquipment: async (id, piece) => (await request(`/equipment/${encodeURIComponent(id)}`, json("PUT", piece))).json(),

  /** @param {string} id */
  removeEquipment: async (id) => void (await request(`/equipment/${encodeURIComponent(id)}`, json("DELETE"))),

  /** @param {string} id @param {File} file @returns {Promise<RegisteredEquipment>} */
  keepCertificate: async (id, file) => {
    const form = new FormData();
    form.append("file", file, file.name);
    return (await request(`/equipment/${encodeURIComponent(id)}/certificate`, { method: "PUT", body: form })).json();
  },

  /** Who did what, the newest first, from a place on. @param {string | null} cursor @returns {Promise<Page<AuditEntry>>} */
  audit: (cursor) => get(cursor ? `/audit?limit=100&cursor=${encodeURIComponent(cursor)}` : "/audit?limit=100"),

  /** @param {string} id */
  reportAddress: (id) => `${ROOT}${session(id)}/report`,
  /** @param {string} id */
  pdfAddress: (id) => `${ROOT}${session(id)}/report?format=pdf`,

  /** @param {string} id */
  archiveAddress: (id) => `${ROOT}${session(id)}/archive`,

  /** A board to print. @param {Record<string, string | number | undefined>} board as `cell.board` */
  boardAddress: (board) => `${ROOT}/board?${new URLSearchParams(Object.entries(board).filter(([, value]) => value !== undefined).map(([name, value]) => [name, String(value)]))}`,

  /** @param {string} id @param {string} captureId @param {string} name */
  fileAddress: (id, captureId, name) => `${ROOT}${capture(id, captureId)}/files/${encodeURIComponent(name.split("/").at(-1) ?? name)}`,

  /** @param {string} id @param {string} name such as `merged.pcd` */
  cloudAddress: (id, name) => `${ROOT}${session(id)}/clouds/${encodeURIComponent(name)}`,

  /** Whether the session has a mesh to compare its cloud with. @param {string} id @returns {Promise<boolean>} */
  hasReference: async (id) => {
    /** @type {{ items: { name: string }[] }} */
    const { items } = await get(`${session(id)}/clouds`);
    return items.some(({ name }) => name === "reference.ply");
  },

  /** A thin slice of the merged cloud. @param {string} id @param {CloudView} view @returns {Promise<CloudSection>} */
  cloudSection: (id, view) => get(`${session(id)}/merged/section?${query({ ...cut(view), at_mm: view.at_mm, ...(view.colors === "deviation" ? compared(view) : {}) })}`),

  /** @param {string} id @param {CloudView} view @returns {Promise<CloudDeviations>} */
  cloudDeviations: (id, view) => get(`${session(id)}/merged/deviation?${query(compared(view))}`),

  /** @param {string} id @param {File} file @returns {Promise<ReferenceMesh>} */
  putReference: async (id, file) => {
    const form = new FormData();
    form.append("file", file, file.name);
    return (await request(`${session(id)}/merged/reference`, { method: "PUT", body: form })).json();
  },

  /** @param {string} id */
  removeReference: async (id) => void (await request(`${session(id)}/merged/reference`, json("DELETE"))),

  /** Show the merged cloud in the scene this way, for all who look. @param {string} id @param {CloudView} view @param {readonly (readonly number[])[]} picked_mm */
  showCloud: async (id, view, picked_mm) => {
    const { colors, axis, at_mm, keep, against, diameter_mm } = view;
    const section = axis ? { ...cut(view), at_mm, keep } : null;
    await fetch(`/scenes/${encodeURIComponent(id)}/cloud`, json("POST", { colors, section, against, diameter_mm, picked_mm }));
  },

  /** @param {string} id */
  eventsAddress: (id) => `${ROOT}${session(id)}/events?alive_s=0.8`,
};
