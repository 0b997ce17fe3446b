// English: the catalogue's one index. Keys are the page's own; values may hold {places}. Another language is a file beside this one, and one in each folder of parts.

import { cell } from "./en/cell.js";
import { common } from "./en/common.js";
import { intake } from "./en/intake.js";
import { problems } from "./en/problems.js";
import { result } from "./en/result.js";
import { review } from "./en/review.js";
import { session } from "./en/session.js";

export const texts = Object.freeze({ ...common, ...problems, ...cell, ...session, ...intake, ...result, ...review });
