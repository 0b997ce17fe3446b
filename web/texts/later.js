// The texts that no first look needs, for the parts that come later and say them: each imports this.

import { take } from "../texts.js";

await take("later/");
