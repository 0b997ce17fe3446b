// English. Review, time line, recomputing.

export const review = {
  "review.archive": "Archive",
  "review.print": "Print",
  "review.log": "Log",

  "kept.title": "Other files from the archive",
  "kept.what": "Files of the imported archive, exactly as they came. They were not made by this server.",
  "kept.open": "Open",
  "kept.open_what": "Open {name} in a new window",
};
