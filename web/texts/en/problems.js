// English. What goes wrong, as the page itself says it; the server's problems bring their own sentences. Each stands in
// tests/web/test_problems.py, where it is provoked.

export const problems = {
  "problem.unreachable_title": "No connection",
  "problem.unreachable": "The server cannot be reached. Nothing is lost; start it again or check the network, then repeat the last step.",
  "problem.unreadable": "The server answered {status}. Try again; if it stays, look into the server's log.",
  "problem.outdated": "Somebody else has changed this meanwhile: {what}. What you typed still stands here; save again to put it in the place of theirs.",
  "problem.login_ended": "Your login has ended. Log in again to go on where you were; poses that you typed are still there.",
  "problem.lacking": "{capture}: the folder lacks {files}. Add what is missing, then drop it again.",

  "new.need_convention": "The robot decides how a pose is read: choose one, or one of the neutral conventions.",
  "new.need_diameter": "A profile needs the sphere's diameter: type it in millimetres.",
  "new.need_number": "A length above zero is needed here: type a number such as 80.003.",
  "new.metres": "{diameter} mm looks like metres: type {millimetres}.",
  "new.need_markers": "A ChArUco board needs its markers' side, smaller than the pitch, and their dictionary.",
  "new.need_board": "Raw frames need the board: type its columns, rows and pitch.",

  "place.need_angle": "An angle in degrees is needed here, such as 45.",

  "intake.bad_json": "The session.json cannot be read as JSON. Mend it in an editor, then drop the folder again.",
  "intake.unknown": "Not measurements: {names}. Profiles are CSV or NPY; clouds PLY, PCD, XYZ or NPY; frames PNG, TIFF, BMP or JPEG.",
  "intake.more_problems": "{count} more captures could not be added. Mend what is said of the others, then add the rest once more.",

  "start.files_first": "These are measurements without a session.json. Make a new session first, then drop them into it.",
  "start.no_session": "No session.json is among these files. Drop the whole session folder, or an archive (zip).",

  "watch.unavailable": "This server watches no folders. Who runs it allows that by SCANCELL_WATCH_ROOT, the folder below which sessions may watch.",

  "tokens.need_name": "Say for whom the token is: a name of a person or a program.",
  "tokens.need_days": "A number of days above zero is needed here, or nothing.",

  "captures.redo_failed": "The new capture {new} is refused, too: {reason} {old} still counts.",

  "may.capture": "You are logged in to look. Capturing, changing and solving take a token with the role capture.",
  "may.admin": "Removing sessions and handing out tokens take a token with the role admin.",

  "lost.title": "There is nothing at this address",
  "lost.words": "The link may be old, or the session was removed.",
};
