// The names that the page uses for what the API gives and takes.

import type {
  AuditEntry, KeptFile, MadeToken, NewToken, TokenRecord,
  CloudDeviations, CloudSection, MergeResidual, MergeResult as MergeRecord, ReferenceMesh,
  CameraResult as CameraRecord, Capture, Cell, ChainResult as ChainRecord, FolderState, Guide, GuideNow, GuideStep, Job, LaserPlaneResult as LaserPlaneRecord, Me, Measured, NewSession, PoseLine, Problem, SessionSummary, StoredCapture, StoredSession,
  CameraResidual, LaserPlaneResidual, TableCircle, TcpResidual, TcpResult as TcpRecord, TurntableResidual, TurntableResult as TurntableRecord,
  AtWorkpiece, Change, Comparison, FrameDifference, MomentOfSession, PastResult, Recomputed, RowDifference, SceneControls, StageReplay, TimelineItem,
} from "./api-types.js";

export type { AuditEntry, KeptFile, MadeToken, NewToken, TokenRecord };
export type { CloudDeviations, CloudSection, MergeResidual, ReferenceMesh, FolderState, Capture, Guide, GuideNow, GuideStep, Job, Me, Measured, SessionSummary, TableCircle, TcpResidual, TurntableResidual };
export type { AtWorkpiece, Change, Comparison, FrameDifference, PastResult, Recomputed, RowDifference, SceneControls, StageReplay, TimelineItem };
export type Moment = MomentOfSession;
/** A folder that is watched, and what came of it. */
export type FolderWatch = NonNullable<FolderState["watch"]>;
export type CaptureOut = StoredCapture;
export type SessionOut = StoredSession;
export type SessionBody = NewSession;
export type ParsedPose = PoseLine;
export type Kind = Capture["kind"];
export type PoseConvention = Cell["pose_convention"];
export type ProblemBody = Pick<Problem, "type" | "title" | "status" | "detail"> & Partial<Problem>;

export interface Page<T> {
  items: T[];
  next: string | null;
}

/** A stored result, and whether captures or cell have changed since. */
type Stored<T> = T & { stale?: boolean; at_workpiece?: AtWorkpiece[]; turned_deg?: Record<string, number> };
export type TcpResult = Stored<TcpRecord>;
export type TurntableResult = Stored<TurntableRecord>;
export type ChainResult = Stored<ChainRecord>;
export type CameraResult = Stored<CameraRecord>;
export type MergeResult = Stored<MergeRecord>;
export type LaserPlaneResult = Stored<LaserPlaneRecord>;
/** A result that has a turntable. */
export type TableResult = TurntableResult | ChainResult;
/** The tool frame as the controllers write it: the export `json`. */
export interface ToolFrame {
  pose_convention: PoseConvention;
  conventions: Record<PoseConvention, ToolNumbers>;
  turntable?: { conventions: Record<PoseConvention, ToolNumbers> };
  chain?: { conventions: Record<PoseConvention, ToolNumbers>; tool_conventions: Record<PoseConvention, ToolNumbers> };
}

export interface ToolNumbers {
  names: string[];
  numbers: number[];
  standard_deviations: number[];
  units: string;
  formula: string;
  controllers: string;
}

export type StageResult = TcpResult | TableResult | CameraResult | LaserPlaneResult | MergeResult;
/** A row of any stage's residuals. */
export type Residual = Pick<TcpResidual, "capture" | "used" | "reason"> & Partial<TcpResidual & TurntableResidual & CameraResidual & LaserPlaneResidual>;
export type Results = Record<string, StageResult>;
