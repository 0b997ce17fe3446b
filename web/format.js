// Numbers as an instrument shows them: always a unit, and only the digits that the uncertainty allows.

import { pointed } from "./texts.js";

const THIN = "\u202f";
const MINUS = "\u2212";
const NANOMETRE_MM = 1e-6;
/** Numbers of five digits are read in groups. */
const LONG = 10_000;

/**
 * With the decimal sign of the page's language; what is copied or sent keeps its point.
 * @param {number} value
 * @param {number} decimals
 */
export function fixed(value, decimals) {
  const text = decimals === 0 && Math.abs(value) >= LONG ? integer(Math.abs(value)) : Math.abs(value).toFixed(decimals);
  return pointed(value < 0 && /[1-9]/.test(text) ? MINUS + text : text);
}

/** A number as a controller writes it, in every language: it is compared with one there, or typed in. @param {number} value @param {number} decimals */
export function forController(value, decimals) {
  const text = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(text) !== 0 ? MINUS + text : text;
}

/** A number as people type it: with a point or a comma, a minus of either kind, its unit behind it or not; NaN where it is none. @param {string} text */
export function typedNumber(text) {
  const plain = text.trim().replace(/\s*(?:mm|°|deg)$/, "").replace(MINUS, "-").replace(",", ".");
  return plain === "" ? NaN : Number(plain);
}

/**
 * Numbers as people type them in a row. A comma between digits is the decimal sign where other signs part the numbers,
 * and for readers who expect it there; else it parts them.
 * @param {string} text
 */
export function typedNumbers(text) {
  const parts = text.split(/[;\s°]+|,(?=\s|$)/).filter(Boolean);
  const decimal = parts.length > 1 || pointed("0.5") === "0,5";
  return parts.flatMap((part) => (decimal && /^[-\u2212+]?\d+,\d+$/.test(part) ? [part] : part.split(",")).filter(Boolean).map(typedNumber));
}

/** A number in a field that people change. @param {unknown} value */
export const inField = (value) => (typeof value === "number" ? pointed(String(value)) : value ?? "");

/** Decimals that show two digits of an uncertainty, as the server's figures do. @param {number} uncertainty */
export function decimalsFor(uncertainty) {
  if (!(uncertainty > 0) || !Number.isFinite(uncertainty)) return 3;
  return Math.min(9, Math.max(0, 1 - Math.floor(Math.log10(uncertainty))));
}

/**
 * `140.321 ± 0.081 mm`.
 * @param {number} value
 * @param {number | null | undefined} uncertainty expanded, k = 2
 * @param {string} unit
 * @param {number} [decimals] as the numbers beside it have
 */
export function measured(value, uncertainty, unit, decimals = decimalsFor(uncertainty ?? 0)) {
  if (!uncertainty || !Number.isFinite(uncertainty)) return `${fixed(value, 3)}${THIN}${unit}`;
  return `${fixed(value, decimals)}\u00a0±\u00a0${fixed(uncertainty, decimals)}${space(unit)}${unit}`;
}

/**
 * An uncertainty alone: `±0.081 mm`.
 * @param {number} uncertainty
 * @param {string} unit
 */
export function plusMinus(uncertainty, unit) {
  return `±${fixed(uncertainty, decimalsFor(uncertainty))}${space(unit)}${unit}`;
}

/** @param {string} unit */
function space(unit) {
  return unit === "°" || unit === "" ? "" : THIN;
}

/**
 * A value to so many significant digits, never in exponents.
 * @param {number} value
 * @param {number} digits
 */
export function significant(value, digits) {
  if (value === 0 || !Number.isFinite(value)) return fixed(value, 0);
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  return fixed(value, Math.min(9, Math.max(0, digits - 1 - exponent)));
}

/**
 * A small length: micrometres below one millimetre. Two digits, three where the first is a 1.
 * @param {number | null | undefined} value_mm
 */
export function small(value_mm) {
  if (value_mm === null || value_mm === undefined || !Number.isFinite(value_mm)) return "–";
  if (Math.abs(value_mm) < NANOMETRE_MM) return `0${THIN}µm`; // what is left of a difference that is none
  const digits = /^[0.]*1/.test(String(Math.abs(value_mm))) ? 3 : 2;
  if (Math.abs(value_mm) < 0.9995) return `${significant(value_mm * 1000, digits)}${THIN}µm`;
  return `${significant(value_mm, digits)}${THIN}mm`;
}

/** How well something is known, as guide and result write it. @param {number} value_mm */
export const stated = (value_mm) => `${significant(value_mm, 2)}${THIN}mm`;

/** @param {number | null | undefined} value_mm */
export function millimetres(value_mm, decimals = 1) {
  return value_mm === null || value_mm === undefined ? "–" : `${fixed(value_mm, decimals)}${THIN}mm`;
}

/** @param {number} count */
export function integer(count) {
  return String(Math.round(count)).replace(/\B(?=(\d{3})+(?!\d))/g, THIN);
}

/** A file's size: `14 kB`. @param {number} count */
export function bytes(count) {
  if (count < 1000) return `${count}${THIN}B`;
  return count < 1e6 ? `${fixed(count / 1000, 0)}${THIN}kB` : `${fixed(count / 1e6, 1)}${THIN}MB`;
}

/** The time of day, as one compares it with a watch. @param {Date} date */
export const clock = (date) => [date.getHours(), date.getMinutes(), date.getSeconds()].map((part) => String(part).padStart(2, "0")).join(":");

/** @param {string | null | undefined} iso */
export function when(iso) {
  if (!iso) return "";
  const date = new Date(iso);
  if (Number.isNaN(date.getTime())) return iso;
  const pad = (/** @type {number} */ number) => String(number).padStart(2, "0");
  const day = `${date.getFullYear()}-${pad(date.getMonth() + 1)}-${pad(date.getDate())}`;
  return `${day} ${pad(date.getHours())}:${pad(date.getMinutes())}`;
}
