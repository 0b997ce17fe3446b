// A cell's chain as data: what carries what, as the record tells it, and back.

/** @import {Cell} from "../api-types.js" */
/** @typedef {"base" | "robot" | "flange" | "scanner" | "ball" | "rotary" | "linear"} Kind */
/**
 * One part of a chain. `on` is the id of what carries it; a part that the record does not name is `implied`.
 * @typedef {{ id: string, kind: Kind, name: string, on: string, implied?: boolean, carries?: "object" | "robot", diameter_mm?: number | null, told?: Record<string, unknown> }} Part
 */

export const BASE = "base", FLANGE = "tool0", ROBOT = "robot";

/** @param {Kind} kind */
export const isAxis = (kind) => kind === "rotary" || kind === "linear";

/** @param {Part[]} parts @param {(part: Part) => boolean} which */
const last = (parts, which) => parts.filter(which).at(-1)?.id ?? BASE;

/** The parts of a cell, each after what carries it. @param {Partial<Cell>} cell @param {boolean} turntable @returns {Part[]} */
export function partsOf(cell, turntable) {
  const fixed = cell.arrangement === "sphere-on-robot";
  /** @type {Part[]} */
  const parts = [{ id: BASE, kind: "base", name: "", on: "", implied: true }];
  for (const axis of cell.axes ?? []) {
    const carries = axis.carries ?? "object";
    parts.push({ id: axis.name, kind: axis.kind, name: axis.name, on: axis.on ?? last(parts, (part) => part.carries === carries), carries, told: { ...axis } });
  }
  if (turntable && !parts.some(({ id }) => id === "table")) parts.push({ id: "table", kind: "rotary", name: "table", on: BASE, carries: "object", implied: true });
  parts.push({ id: ROBOT, kind: "robot", name: "", on: last(parts, (part) => part.carries === "robot"), implied: true });
  parts.push({ id: FLANGE, kind: "flange", name: "", on: ROBOT, implied: true });
  const scanners = /** @type {[string, { on?: string }][]} */ (Object.entries(cell.scanners ?? {}));
  for (const [name, told] of scanners.length ? scanners : [/** @type {[string, { on?: string }]} */ (["", {}])]) {
    parts.push({ id: `scanner:${name}`, kind: "scanner", name, on: told.on ?? (fixed ? BASE : FLANGE), implied: !name, told });
  }
  const end = parts.some((part) => part.kind === "scanner" && part.on === FLANGE) ? BASE : FLANGE;
  for (const ball of cell.spheres ?? []) parts.push({ id: `ball:${ball.name}`, kind: "ball", name: ball.name, on: ball.on ?? end, diameter_mm: ball.diameter_mm ?? null, told: { ...ball } });
  if (!cell.spheres?.length) parts.push({ id: "ball:", kind: "ball", name: "", on: end, implied: true });
  return parts;
}

/** What the record says of a chain: the plain cell says nothing. @param {Part[]} parts @returns {Partial<Cell>} */
export function cellOf(parts) {
  const scanners = parts.filter(({ kind }) => kind === "scanner"), balls = parts.filter(({ kind, implied }) => kind === "ball" && !implied);
  const axes = parts.filter(({ kind, implied }) => isAxis(kind) && !implied);
  const named = scanners.filter(({ name }) => name);
  return /** @type {Partial<Cell>} */ ({
    arrangement: named.length === 0 && scanners[0]?.on === BASE ? "sphere-on-robot" : undefined,
    scanners: named.length ? Object.fromEntries(named.map(({ name, on, told }) => [name, { ...told, on }])) : undefined,
    spheres: balls.length ? balls.map(({ name, on, diameter_mm, told }) => ({ ...told, name, on, diameter_mm: diameter_mm ?? undefined })) : undefined,
    axes: axes.length ? axes.map(({ name, kind, on, carries, told }) => ({ ...told, name, kind, carries, on })) : undefined,
  });
}

/** What may carry a part: nothing that it carries itself. @param {Part[]} parts @param {Part} part */
export function carriersOf(parts, part) {
  const own = new Set([part.id]);
  for (const other of parts) if (own.has(other.on)) own.add(other.id);
  const may = (/** @type {Part} */ other) =>
    part.kind === "scanner" ? [BASE, FLANGE].includes(other.id)
    : part.kind === "ball" ? [BASE, FLANGE].includes(other.id) || other.carries === "object"
    : isAxis(part.kind) && (other.id === BASE || (isAxis(other.kind) && other.carries === part.carries));
  return parts.filter((other) => !own.has(other.id) && may(other));
}

/** The robot stands on the last axis that carries it, and a ball nobody named at the robot's other end. @param {Part[]} parts */
export function settle(parts) {
  const carrying = parts.filter(({ kind, carries }) => isAxis(kind) && carries === "robot");
  const top = carrying.find(({ id }) => !carrying.some(({ on }) => on === id));
  const flange = parts.some(({ kind, on }) => kind === "scanner" && on === FLANGE);
  const ordered = [...parts.filter(({ kind }) => kind === "base")];
  const rest = parts.filter(({ kind }) => kind !== "base").map((part) => part.id === ROBOT ? { ...part, on: top?.id ?? BASE } : part.kind === "ball" && part.implied ? { ...part, on: flange ? BASE : FLANGE } : part);
  for (let turn = 0; rest.length && turn < 100; turn++) {
    const ready = rest.filter(({ on }) => ordered.some(({ id }) => id === on));
    ordered.push(...ready);
    for (const part of ready) rest.splice(rest.indexOf(part), 1);
  }
  return ordered;
}

/** A name that no other part has. @param {Part[]} parts @param {string} stem */
export function newName(parts, stem) {
  for (let number = 1; ; number++) if (!parts.some(({ name }) => name === `${stem}${number}`)) return `${stem}${number}`;
}

/** @param {Part[]} parts @param {Kind} kind @param {string} stem */
export function withNew(parts, kind, stem) {
  const name = newName(parts, stem);
  if (isAxis(kind)) return settle([...parts, { id: name, kind, name, on: last(parts, ({ carries }) => carries === "object"), carries: "object" }]);
  // What was implied becomes one of several, and takes a name.
  let first = name;
  const told = parts.map((part) => {
    if (part.kind !== kind || !part.implied) return part;
    const { implied: _, ...rest } = part;
    first = newName([...parts, { ...part, name }], stem);
    return { ...rest, id: `${kind}:${name}`, name };
  });
  const on = parts.find((part) => part.kind === kind)?.on ?? BASE;
  return settle([...told, { id: `${kind}:${first}`, kind, name: first, on }]);
}

/** @param {Part[]} parts @param {Part} part @param {Partial<Part>} change */
export function withChange(parts, part, change) {
  const named = change.name ?? part.name, id = isAxis(part.kind) ? named : `${part.kind}:${named}`;
  const after = { ...part, ...change, id };
  const own = change.carries && change.carries !== part.carries;
  return settle(parts.map((other) => {
    if (other.id === part.id) return own ? { ...after, on: BASE } : after;
    if (other.on !== part.id) return other;
    return { ...other, on: own ? part.on : id };
  }));
}

/** What it carried stands on what carried it. @param {Part[]} parts @param {Part} part */
export function without(parts, part) {
  const left = parts.filter(({ id }) => id !== part.id).map((other) => (other.on === part.id ? { ...other, on: part.on } : other));
  const same = left.filter(({ kind }) => kind === part.kind);
  if (part.kind === "ball" && same.length === 0) left.push({ id: "ball:", kind: "ball", name: "", on: BASE, implied: true });
  return settle(left);
}
