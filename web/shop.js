// Shop floor: for a tablet at arm's length. Large type, one huge action, and a tone that tells how a capture or a result was.

import { style } from "./dom.js";

const KEY = "scancell-shop", QUIET = "scancell-quiet";
const ROOT = document.documentElement;
/** Tones in Hz: rising is good, falling is refused. @type {Readonly<Record<string, readonly number[]>>} */
const TONES = { pass: [660, 880], warn: [660, 660], fail: [440, 262] };
const TONE_S = 0.16;
let styled = false;

export const atShop = () => ROOT.hasAttribute("data-shop");

/** @param {boolean} on */
export function setShop(on) {
  if (on && !styled) style("shop");
  styled ||= on;
  ROOT.toggleAttribute("data-shop", on);
  if (on) window.localStorage.setItem(KEY, "1");
  else window.localStorage.removeItem(KEY);
}

/** Whether the mode for the shop floor may be heard. */
export const mayBeHeard = () => !window.localStorage.getItem(QUIET);

/** @param {boolean} on */
export function letBeHeard(on) {
  if (on) window.localStorage.removeItem(QUIET);
  else window.localStorage.setItem(QUIET, "1");
}

/** Tell a verdict by a sound: in the mode for the shop floor, or where it was asked for. @param {string} verdict @param {boolean} [asked] */
export function sound(verdict, asked = atShop() && mayBeHeard()) {
  if (!asked || typeof AudioContext === "undefined") return;
  const audio = new AudioContext();
  const tones = TONES[verdict] ?? [];
  tones.forEach((frequency, index) => {
    const [tone, volume] = [audio.createOscillator(), audio.createGain()];
    const start = audio.currentTime + index * TONE_S;
    tone.frequency.value = frequency;
    volume.gain.setValueAtTime(0.2, start);
    volume.gain.exponentialRampToValueAtTime(0.001, start + TONE_S);
    tone.connect(volume).connect(audio.destination);
    tone.start(start);
    tone.stop(start + TONE_S);
  });
  window.setTimeout(() => void audio.close(), 1000 * TONE_S * (tones.length + 1));
}

if (window.localStorage.getItem(KEY)) setShop(true);
