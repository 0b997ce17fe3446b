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
  // An answer is verified before it is used.
  const order = all.slice(all.indexOf(step) + 1);
  const next = order.find((one) => isOpen(steps.find((told) => told.step === one)?.status)) ?? null;
  return next ?? (current.action === "review" || current.step === step ? null : current.step);
}
