// English. A new session, and the cell's own data: scanner, robot, sphere, board.

export const cell = {

  "kind.profile": "profiles",
  "kind.cloud": "point clouds",
  "kind.center": "sphere centres",
  "kind.frame": "camera frames",
  "kind.sweep": "sweeps",

  "convention.abb": "ABB",
  "convention.fanuc": "FANUC",
  "convention.kawasaki": "Kawasaki",
  "convention.kuka": "KUKA",
  "convention.mitsubishi": "Mitsubishi",
  "convention.nachi": "Nachi",
  "convention.staubli": "Stäubli",
  "convention.ur": "Universal Robots",
  "convention.yaskawa": "Yaskawa",
  "convention.ros": "ROS",
  "convention.matrix": "matrix, 16 numbers in rows",
  "convention.quaternion-xyzw": "quaternion x y z w",
  "convention.quaternion-wxyz": "quaternion w x y z",

  "cell.sphere": "sphere {diameter} mm",
  "cell.correct": "Edit cell",
  "cell.changed": "Cell changed",
  "cell.simulated": "simulated",
};
