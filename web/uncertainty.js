// What a pose's covariance says about its numbers. Its order is rx ry rz tx ty tz, rad and mm: the turn perturbs on the
// right, so about L's axes; the translation is along the flange's.

/** @import {TcpResult} from "./model.js" */

const DEGREE = Math.PI / 180;

/** @param {readonly (readonly number[])[]} matrix @param {number} row @param {number} column */
const entry = (matrix, row, column) => matrix[row]?.[column] ?? 0;

/**
 * Standard deviations of the translation along the flange's axes.
 * @param {Pick<TcpResult, "covariance">} result
 */
export function positionSigmas_mm({ covariance }) {
  return [3, 4, 5].map((axis) => Math.sqrt(Math.max(entry(covariance, axis, axis), 0)));
}

/** Standard deviations of small turns about L's axes. @param {readonly (readonly number[])[]} covariance */
export function rotationSigmas_deg(covariance) {
  return [0, 1, 2].map((axis) => Math.sqrt(Math.max(entry(covariance, axis, axis), 0)) / DEGREE);
}

/** @param {readonly number[]} sigmas */
export const worst = (sigmas) => Math.max(...sigmas);

/**
 * The standard deviation of the difference of an answer and of a better one from the same captures: the better one has
 * used all there is, so that the variance of the difference is that of the one less that of the other.
 * @param {number} variance of the answer
 * @param {number} better variance of the better one
 */
export function differenceSigma(variance, better) {
  return Math.sqrt(variance > better ? variance - better : Math.max(variance, better, 0));
}

/**
 * How far another answer is turned against this one, also in units of the standard deviation of that difference.
 * @param {Pick<TcpResult, "tool0_from_laser" | "covariance">} result
 * @param {readonly (readonly number[])[]} other
 * @param {readonly (readonly number[])[] | null} covariance of the other answer, where it is known
 */
export function differenceInSigmas({ tool0_from_laser: pose, covariance: better }, other, covariance = null) {
  // laser_from_other = Rᵀ R': its antisymmetric part is the small turn between them.
  const turn = (/** @type {number} */ i, /** @type {number} */ j) => [0, 1, 2].reduce((sum, k) => sum + entry(pose, k, i) * entry(other, k, j), 0);
  const vector = [(turn(2, 1) - turn(1, 2)) / 2, (turn(0, 2) - turn(2, 0)) / 2, (turn(1, 0) - turn(0, 1)) / 2];
  const sine = Math.hypot(...vector);
  const cosine = (turn(0, 0) + turn(1, 1) + turn(2, 2) - 1) / 2;
  const angle = Math.atan2(sine, cosine);
  if (sine === 0) return { angle_deg: 0, sigmas: 0 };
  const axis = vector.map((part) => part / sine);
  const along = (/** @type {readonly (readonly number[])[]} */ matrix) => [0, 1, 2].reduce((sum, i) => sum + [0, 1, 2].reduce((part, j) => part + (axis[i] ?? 0) * entry(matrix, i, j) * (axis[j] ?? 0), 0), 0);
  const sigma = covariance ? differenceSigma(along(covariance), along(better)) : Math.sqrt(Math.max(along(better), 0));
  return { angle_deg: angle / DEGREE, sigmas: sigma > 0 ? angle / sigma : 0 };
}
