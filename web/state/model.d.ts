// The names that the page uses for what the API gives and takes.

import type {
  AuditEntry, KeptFile, MadeToken, TokenRequest, TokenRecord,
  CloudDeviations, CloudSection, MergeResult as MergeRecord, ReferenceMesh,
  CameraResult as CameraRecord, Capture, Cell, CellDrift, CellSummary, DriftSeries, FolderState, Guide, GuideNow, Meter, Job, Me, Measured, SessionRequest, Release, SessionAnswer, PoseLine, PoseLines as PoseLinesRead, LikelyConvention, Problem, SessionSummary, StoredCapture, StoredSession,
  CameraResidual, LaserPlaneResidual, TcpResidual, TcpResult as TcpRecord, TurntableResidual,
  Figure, Frame, Note, Picture, Plot, PoseConventionEntry, Quantity, StageOfCell, Table,
  BoardFacing, ControllerFileContent, FileReading, PoseOfFile, RecognisedFiles, RecognisedPose, ToolComparison,
  AppliedChanges, Changes, CodeOfFinding, Finding, RootCause, RootCauses,
  Change, Comparison, OffTheTruth, FrameDifference, MomentOfSession, PastResult, RecheckPlan, Recomputed, RowDifference, SceneControls, StageReplay, TimelineItem,
} from "../api-types.js";

export type { AuditEntry, KeptFile, MadeToken, TokenRequest, TokenRecord };
export type { CloudDeviations, CloudSection, ReferenceMesh, FolderState, Capture, Guide, GuideNow, Job, Me, Measured, Meter, SessionSummary };
export type { Change, Comparison, OffTheTruth, FrameDifference, PastResult, RecheckPlan, Recomputed, RowDifference, SceneControls, StageReplay, TimelineItem };
export type { BoardFacing, CellDrift, CellSummary, DriftSeries, Release, SessionAnswer };
export type { FileReading, RecognisedFiles, RecognisedPose, ToolComparison };
export type ControllerFile = ControllerFileContent;
export type FilePose = PoseOfFile;
export type { AppliedChanges, Changes, CodeOfFinding, Finding, RootCause, RootCauses };
export type Moment = MomentOfSession;
/** A folder that is watched, and what came of it. */
export type FolderWatch = NonNullable<FolderState["watch"]>;
export type CaptureOut = StoredCapture;
export type SessionOut = StoredSession;
export type SessionBody = SessionRequest;
export type ParsedPose = PoseLine;
export type { LikelyConvention };
export type PoseLines = PoseLinesRead;
export type Kind = Capture["kind"];
export type PoseConvention = Cell["pose_convention"];
export type ProblemBody = Pick<Problem, "type" | "title" | "status" | "detail"> & Partial<Problem>;

export interface Page<T> {
  items: T[];
  next: string | null;
}

/** A stored result, and whether captures or cell have changed since. */
type Stored<T> = T & { stale?: boolean };
/** What all results have; the rest is told by their evidence. */
export type StageResult = Pick<Stored<TcpRecord>, "stage" | "method" | "software" | "inputs_sha256" | "verdict" | "findings" | "causes" | "evidence" | "stale"> & { residuals: Residual[] };
export type MergeResult = Stored<MergeRecord>;
export type CameraResult = Stored<CameraRecord>;
/** A row of any stage's residuals. */
export type Residual = Pick<TcpResidual, "capture" | "used" | "reason"> & Partial<TcpResidual & TurntableResidual & CameraResidual & LaserPlaneResidual>;
export type Results = Record<string, StageResult>;

/** Blocks of evidence, as their kinds tell them apart. */
export type Block = FigureBlock | FrameBlock | TableBlock | PlotBlock | PictureBlock | NoteBlock;
export type FigureBlock = Figure & { kind: "figure" };
export type FrameBlock = Frame & { kind: "frame" };
export type TableBlock = Table & { kind: "table" };
export type PlotBlock = Plot & { kind: "plot" };
export type PictureBlock = Picture & { kind: "picture" };
export type NoteBlock = Note & { kind: "note" };
export type { Quantity };
export type AxisOf = Plot["x"];
export type SeriesOf = Plot["series"][number];
export type ColumnOf = Table["columns"][number];
export type RowOf = Table["rows"][number];
export type CellOf = RowOf["cells"][number];

/** What the server says of a stage. */
export type StageInfo = StageOfCell;
export type ConventionInfo = PoseConventionEntry & { name: PoseConvention };

/** How the merged cloud is looked at. */
export interface CloudView {
  colors: "height" | "scan" | "intensity" | "deviation";
  axis: "" | "x" | "y" | "z" | "plane";
  /** Of the plane that was picked. */
  normal: readonly number[] | null;
  at_mm: number;
  keep: "below" | "above";
  against: "mesh" | "sphere";
  diameter_mm: number | null;
}
