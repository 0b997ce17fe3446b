// The way on from the step that is open.

/** @param {string | undefined} status */
const isOpen = (status) => status === "todo" || status === "working" || status === "stale";

/** The step that asks for something while the open one asks for nothing. @param {import("./session.js").SessionState} state */
export function nextStep({ now, guide, step, stages, steps: all }) {
  const status = guide?.steps.find((one) => one.step === step)?.status;
  if (!guide || (now && now.action !== "review")) return null;
  // What nobody has to do (a recheck) is done where it was opened.
  if (!now && status === undefined && stages.some(({ step: own }) => own?.name === step)) return null;
  // A step may be worked on before its turn; once what comes first is only to be solved, the way leads there.
  if (!now && isOpen(status) && guide.current.action !== "solve") return null;
  const { current, steps } = guide;
  if (!now && isOpen(status)) return current.step === step ? null : current.step;
  // In the order of the rail: what lies behind is mended first, and an answer is verified before it is used. Where nothing is asked
  // for any more, verifying is what is left; a table or scans are for those who have them.
  const isWanted = (/** @type {string} */ one) => current.action !== "review" || stages.some(({ name, step: own }) => name === "verify" && own?.name === one);
  const open = all.slice(all.indexOf(step) + 1).find((one) => isWanted(one) && isOpen(steps.find((told) => told.step === one)?.status));
  const wanted = [current.action === "review" ? undefined : current.step, open].filter((one) => one !== undefined && one !== step);
  return all.find((one) => wanted.includes(one)) ?? null;
}
