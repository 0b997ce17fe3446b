// English: the catalogue's one index. Keys are the page's own; values may hold {places}. Another language is another folder beside en/.

import { cell } from "./en/cell.js";
import { common } from "./en/common.js";
import { intake } from "./en/intake.js";
import { merge } from "./en/merge.js";
import { problems } from "./en/problems.js";
import { result } from "./en/result.js";
import { review } from "./en/review.js";
import { session } from "./en/session.js";
import { start } from "./en/start.js";

export const texts = Object.freeze({ ...common, ...problems, ...start, ...cell, ...session, ...intake, ...result, ...merge, ...review });
