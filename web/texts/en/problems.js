// English. What goes wrong, as the page itself says it; the server's problems bring their own sentences. Each stands in
// tests/web/test_problems.py, where it is provoked.

export const problems = {
  "problem.unreachable_title": "No connection",
  "problem.unreachable": "The server cannot be reached. Nothing is lost. Start it again or check the network, then repeat the last step.",
  "problem.unreadable": "The server answered {status}. Try again. If this persists, check the server log.",
  "problem.outdated": "Someone else changed this in the meantime: {what}. Your input is still here. Save again to overwrite their change.",
  "problem.login_ended": "Your login has expired. Log in again to continue where you were. Poses that you typed are still there.",
  "problem.lacking": "{capture}: the folder lacks {files}. Add the files, then drop the folder again.",

  "place.need_angle": "Enter an angle in degrees, such as 45.",

  "intake.bad_json": "The file session.json is not valid JSON. Fix it in an editor, then drop the folder again.",
  "intake.more_problems": "{count} more captures could not be added. Fix the problems above, then add the rest.",

  "start.no_session": "There is no session.json among these files. Drop the whole session folder, or an archive (zip).",

  "watch.unavailable": "This server watches no folders. The operator can allow it with SCANCELL_WATCH_ROOT.",

  "tokens.need_name": "Enter the name of a person or a program.",
  "tokens.need_days": "Enter a number of days above zero, or nothing.",

  "captures.redo_failed": "The new capture {new} was refused, too: {reason} {old} is still used.",

  "may.capture": "Your login can only view. Capturing, changing and solving need the role capture.",
  "may.release": "Approving and rolling back need the role release.",
  "may.admin": "Deleting sessions and managing access need the role admin.",

  "lost.title": "Page not found",
  "lost.words": "The link may be old, or the session was deleted.",
  "new.need_convention": "The robot decides how a pose is read. Choose one, or one of the neutral conventions.",
  "new.need_diameter": "Profiles need the sphere diameter. Enter it in millimetres.",
  "new.need_number": "Enter a length above zero, such as 80.003.",
  "new.metres": "{diameter} mm looks like metres. Enter {millimetres}.",
  "new.need_markers": "A ChArUco board needs its marker size, smaller than the pitch, and its dictionary.",
  "new.need_board": "Camera frames need the board. Enter columns, rows and pitch.",
};
