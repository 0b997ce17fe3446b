// The way on from the step that is open.

/** The step that asks for something while the open one asks for nothing. @param {import("./session.js").SessionState} state */
export function nextStep({ now, guide, step, stages }) {
  const status = guide?.steps.find((one) => one.step === step)?.status;
  if (!guide || (now && now.action !== "review")) return null;
  // What nobody has to do (a recheck) is done where it was opened.
  if (!now && status === undefined && stages.some(({ step: own }) => own?.name === step)) return null;
  // A step may be worked on before its turn; once what comes first is only to be solved, the way leads there.
  const open = status === "todo" || status === "working" || status === "stale";
  if (!now && open && guide.current.action !== "solve") return null;
  if (!now || guide.current.action !== "review") return guide.current.step === step ? null : guide.current.step;
  const place = guide.steps.findIndex((one) => one.step === step);
  return guide.steps.slice(place + 1).find(({ status }) => status === "todo" || status === "stale" || status === "working")?.step ?? null;
}
