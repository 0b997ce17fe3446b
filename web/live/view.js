// What the scanner sees, drawn on a canvas: a camera's image with stripe and arc, the profile beside it or alone.

/** @import {LiveExposure, Preview} from "../state/live.js" */
/** @typedef {{ x: number, y: number, width: number, height: number }} Box */

const WIDTH = 960;
const PROFILE_HEIGHT = 480;
const INSET = 0.36;

/** @param {HTMLCanvasElement} canvas @param {Preview} preview @param {ImageBitmap | null} image */
export function drawPreview(canvas, { exposure }, image) {
  const picture = exposure?.picture ?? null;
  const height = picture ? Math.round((WIDTH * picture.size[1]) / picture.size[0]) : PROFILE_HEIGHT;
  if (canvas.width !== WIDTH || canvas.height !== height) Object.assign(canvas, { width: WIDTH, height });
  const pen = canvas.getContext("2d");
  if (!pen) return;
  const colours = getComputedStyle(canvas);
  const [ground, faint, accent, laser] = ["--sunk", "--faint", "--accent", "--laser"].map((name) => colours.getPropertyValue(name));
  pen.fillStyle = ground ?? "";
  pen.fillRect(0, 0, WIDTH, height);
  const tones = { faint: faint ?? "", accent: accent ?? "", laser: laser ?? "" };
  if (!exposure) return;
  if (!picture) return drawProfile(pen, exposure, { x: 0, y: 0, width: WIDTH, height }, tones);
  if (image) pen.drawImage(image, 0, 0, WIDTH, height);
  const unit = WIDTH / picture.size[0];
  pen.fillStyle = tones.accent;
  for (const [x, y] of picture.stripe) pen.fillRect(x * unit - 1, y * unit - 1, 2.5, 2.5);
  path(pen, picture.arc.map(([x, y]) => [x * unit, y * unit]), tones.laser);
  if (!exposure.points.length) return;
  const box = { x: WIDTH * (1 - INSET), y: height - WIDTH * INSET * 0.6, width: WIDTH * INSET, height: WIDTH * INSET * 0.6 };
  pen.globalAlpha = 0.85;
  pen.fillStyle = ground ?? "";
  pen.fillRect(box.x, box.y, box.width, box.height);
  pen.globalAlpha = 1;
  drawProfile(pen, exposure, box, tones);
}

/** @param {CanvasRenderingContext2D} pen @param {LiveExposure} exposure @param {Box} box @param {{ faint: string, accent: string, laser: string }} tones */
function drawProfile(pen, { points, on_arc, circle }, box, tones) {
  const around = circle ? [[circle[0] - 1.7 * circle[2], circle[1] - 1.2 * circle[2]], [circle[0] + 1.7 * circle[2], circle[1] + 1.2 * circle[2]]] : points;
  if (!around.length) return;
  const [xs, zs] = [around.map(([x = 0]) => x), around.map(([, z = 0]) => z)];
  const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...zs), Math.max(...zs)];
  const unit = 0.94 * Math.min(box.width / Math.max(right - left, 1), box.height / Math.max(high - low, 1));
  const place = (/** @type {number} */ x, /** @type {number} */ z) => [box.x + box.width / 2 + (x - (left + right) / 2) * unit, box.y + box.height / 2 + (z - (low + high) / 2) * unit];
  pen.save();
  pen.beginPath();
  pen.rect(box.x, box.y, box.width, box.height);
  pen.clip();
  points.forEach(([x, z], index) => {
    const [px = 0, py = 0] = place(x, z);
    pen.fillStyle = on_arc[index] ? tones.accent : tones.faint;
    pen.fillRect(px - 1.5, py - 1.5, 3, 3);
  });
  if (circle) {
    const [cx = 0, cy = 0] = place(circle[0], circle[1]);
    pen.strokeStyle = tones.laser;
    pen.setLineDash([8, 6]);
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(cx, cy, circle[2] * unit, 0, 2 * Math.PI);
    pen.stroke();
  }
  pen.restore();
}

/** @param {CanvasRenderingContext2D} pen @param {number[][]} places @param {string} colour */
function path(pen, places, colour) {
  pen.strokeStyle = colour;
  pen.setLineDash([8, 6]);
  pen.lineWidth = 2;
  pen.beginPath();
  for (const [x = 0, y = 0] of places) pen.lineTo(x, y);
  pen.stroke();
  pen.setLineDash([]);
}
