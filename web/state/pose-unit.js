// Poses whose places stand in metres, told before anything is stored.

import { NUMBERS } from "./pose-table.js";

/** @import {ParsedPose} from "./model.js" */

/** No arm works within so little about its base. */
const NEAREST_MM = 15;
const IN_METRES = 1000;

/** The numbers of a pose that are its place. @param {string} convention */
const placesOf = (convention) => (NUMBERS[convention] ?? []).map((name) => ["x", "y", "z"].includes(name.toLowerCase()));

/** Whether places that were read as millimetres are metres. @param {readonly ParsedPose[]} poses @param {string} convention */
export function lookLikeMetres(poses, convention) {
  if (!placesOf(convention).includes(true)) return false;
  const farthest = Math.max(0, ...poses.map(({ matrix }) => (matrix ? Math.hypot(...placeOf(matrix)) : 0)));
  return poses.some(({ matrix }) => matrix) && farthest > 0 && farthest < NEAREST_MM;
}

/** The same pose with its place read in metres. @param {ParsedPose} pose @param {string} convention @returns {ParsedPose} */
export function readInMetres(pose, convention) {
  const places = placesOf(convention);
  const numbers = pose.numbers?.map((value, index) => (value !== null && places[index] ? value * IN_METRES : value)) ?? pose.numbers;
  const matrix = pose.matrix?.map((row, index) => (index < 3 ? [...row.slice(0, 3), (row[3] ?? 0) * IN_METRES] : row)) ?? pose.matrix;
  return { ...pose, numbers, matrix };
}

/** @param {number[][]} matrix */
const placeOf = (matrix) => [0, 1, 2].map((row) => matrix[row]?.[3] ?? 0);
