// A session at a place of its time line: what was there then, to look at. Nothing here changes the session.

import { api } from "./api.js";
import { Problem, randomName } from "./http.js";
import { SessionState } from "./session.js";
import { stages } from "./registries.js";

/** @import {Moment, Results, TimelineItem} from "./model.js" */

const MOST_KEPT = 60;

export class ReviewState extends SessionState {
  /** @type {TimelineItem[]} */ timeline = [];
  place = -1;
  /** The results' numbers in the history. @type {Record<string, number>} */ numbers = {};
  /** @type {Map<number, Moment>} */ #known = new Map();
  #wanted = -1;
  #loading = false;

  /** @override */
  async start() {
    try {
      const [session, timeline, known] = await Promise.all([api.session(this.id), api.timeline(this.id), stages()]);
      this.stages = known;
      this.timeline = timeline;
      // A scene of its own moves through time without taking others along.
      this.session = { ...session, scene: `/scenes/${this.id}.r${randomName()}/` };
      this.tell("session");
      await this.go(startOf(timeline));
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      this.problem = error;
      this.tell("problem", "session");
    }
  }

  /**
   * Move to a place. While one moment is on its way, only the last place that was asked for is remembered.
   * @param {number} place
   */
  async go(place) {
    this.#wanted = Math.max(0, Math.min(place, this.timeline.length - 1));
    if (this.#loading) return;
    this.#loading = true;
    try {
      while (this.#wanted !== this.place) this.#show(await this.#moment(this.#wanted));
    } finally {
      this.#loading = false;
    }
  }

  /** The place that was asked for last; what is shown may still be on its way there. */
  get wanted() {
    return this.#wanted;
  }

  get item() {
    return this.timeline[this.place] ?? null;
  }

  /** @param {number} place */
  async #moment(place) {
    const known = this.#known.get(place);
    if (known) return known;
    const moment = await api.moment(this.id, place);
    this.#known.set(place, moment);
    const oldest = this.#known.keys().next();
    if (this.#known.size > MOST_KEPT && !oldest.done) this.#known.delete(oldest.value);
    return moment;
  }

  /** @param {Moment} moment */
  #show(moment) {
    const { place, captures, guide, numbers } = moment;
    const results = /** @type {Results} */ (/** @type {unknown} */ (moment.results));
    const session = this.session && { ...this.session, name: moment.session.name ?? "", cell: moment.session.cell };
    Object.assign(this, { place, captures, guide, numbers, results, session });
    this.view = this.resultOf(this.step) ? "result" : "measure";  // of the scene: it tells what stands beside it
    if (this.selected && !captures.some((capture) => capture.id === this.selected)) this.selected = null;
    this.tell("place", "session", "captures", "guide", "results", "view", "selection");
  }
}

/** The last solve is what one wants to see first. @param {TimelineItem[]} timeline */
function startOf(timeline) {
  return timeline.findLast((item) => item.kind === "result")?.place ?? timeline.length - 1;
}
