// The names that the page uses for what the API gives and takes.

import type {
  Capture, Cell, Guide, GuideNow, GuideStep, Job, Measured, NewSession, PoseLine, Problem, SessionSummary, StoredCapture, StoredSession,
  TcpResidual, TcpResult as TcpRecord,
} from "./api-types.js";

export type { Capture, Guide, GuideNow, GuideStep, Job, Measured, SessionSummary, TcpResidual };
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
export type TcpResult = TcpRecord & { stale?: boolean };
/** The tool frame as the controllers write it: the export `json`. */
export interface ToolFrame {
  pose_convention: PoseConvention;
  conventions: Record<PoseConvention, ToolNumbers>;
}

export interface ToolNumbers {
  names: string[];
  numbers: number[];
  standard_deviations: number[];
  units: string;
  formula: string;
  controllers: string;
}

export type StageResult = TcpResult;
export type Results = Record<string, StageResult>;
