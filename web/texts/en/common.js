// English. What every page needs.

export const common = {
  "skip": "Skip to the content",
  "close": "Close",
  "cancel": "Cancel",
  "notices": "Notices",
  "copied": "Copied",
  "name": "Name",
  "choose": "Choose …",
  "key.space": "Space",

  "undo": "Undo",
  "undo.what": "Undo: {what}",
  "undo.done": "Undone: {what}",
  "undo.nothing": "There is nothing to undo.",

  "theme.to_dark": "Switch to the dark theme",
  "theme.to_light": "Switch to the light theme",

  "login.title": "Log in",
  "login.token": "Token",
  "login.hint": "It starts with scancell_ and was given to you by an administrator.",
  "login.go": "Log in",
  "login.how": "I have no token",
  "login.how_words": "An administrator creates one on the server with this command. The role is read, capture or admin.",

  "menu.open": "More",
  "menu.who_machine": "No login: this server only answers its own machine.",
  "menu.role_read": "can view everything",
  "menu.role_capture": "can view, capture and solve",
  "menu.role_release": "can view, capture, solve and approve", "menu.role_admin": "can do everything",
  "menu.docs": "API",
  "menu.log_out": "Log out",

  "lost.back": "Back to all sessions",

  "step.camera": "Camera",
  "step.laser-plane": "Laser plane",
  "step.tcp": "TCP",
  "step.turntable": "Turntable",
  "step.chain": "Whole chain",
  "step.verify": "Verify",
  "step.recheck": "Recheck",
  "step.plate": "Flat plate",
  "step.hand-eye": "Board hand-eye",
  "step.scan": "Scan",
  "step.merge": "Merge",

  "redo.what": "Redo: {what}",
  "redo.done": "Redone: {what}",
  "redo.nothing": "There is nothing to redo.",
  "menu.shop": "Shop floor: large type, one action, sound",
  "menu.sound": "Sound",
  "menu.language": "Language",
  "menu.keys": "Keys",
  "access.title": "Access",
  "comparison.wait": "Comparing …",
};
