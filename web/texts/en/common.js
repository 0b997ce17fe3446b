// English. What every page needs.

export const common = {
  "skip": "Skip to the content",
  "close": "Close",
  "cancel": "Cancel",
  "notices": "Notices",
  "copied": "Copied",
  "key.space": "Space",

  "undo": "Undo",
  "undo.button": "Take back",
  "undo.what": "Take back: {what}",
  "undo.done": "Taken back: {what}",
  "undo.nothing": "There is nothing to take back.",

  "theme.to_dark": "Switch to the dark theme",
  "theme.to_light": "Switch to the light theme",

  "login.title": "Log in",
  "login.token": "Token",
  "login.hint": "It begins with scancell_ and came from an admin of this server.",
  "login.go": "Log in",
  "login.how": "I have no token",
  "login.how_words": "An admin makes one on the server with this command; the role is read, capture or admin.",

  "menu.open": "More",
  "menu.title": "More",
  "menu.who_machine": "Without login: this server answers on its own machine alone.",
  "menu.who": "{name}",
  "menu.role_read": "may look at everything",
  "menu.role_capture": "may look, capture and solve",
  "menu.role_admin": "may do everything",
  "menu.docs": "API",
  "menu.log_out": "Log out",

  "lost.back": "Back to all sessions",

  "step.camera": "Camera",
  "step.laser-plane": "Laser plane",
  "step.tcp": "TCP",
  "step.turntable": "Turntable",
  "step.chain": "Whole chain",
  "step.verify": "Verify",
  "step.scan": "Scan",
  "step.merge": "Merge",
};
