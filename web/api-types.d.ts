// Generated from the API's OpenAPI document by tests/web/api_types.py; do not edit.

export interface Acknowledged {
  number: number;
  cell: string;
  fault: string;
  of: string[];
  who: string;
  why: string;
  created: string;
}

export interface Acknowledgement {
  fault: string;
  why?: string;
}

export interface Agreement {
  with_stage: string;
  angle_deg: number;
  shift_mm: number;
  sigmas: number[];
  distance: number;
  degrees_of_freedom?: number;
  chance: number;
}

export interface Alignment {
  method: "none" | "best-fit" | "3-2-1" | "matrix";
  rms_mm?: number | null;
  base_from_reference: number[][];
  cloud_from_reference: number[][];
  covariance?: number[][] | null;
  alike?: number;
  reference_sha256: string;
}

export interface AnsweredFrame {
  matrix: number[][];
  covariance: number[][];
  numbers: number[];
  number_sigmas: number[];
}

export interface AppliedChanges {
  session: StoredSession;
  changes: Changes;
  undo: Changes;
}

export interface ArchiveFacts {
  session: string;
  captures: number;
  results: Record<string, "pass" | "warn" | "fail">;
  software: string[];
  files: number;
  payload_bytes: number;
  scene: boolean;
  report: boolean;
  inputs_sha256?: Record<string, string>;
  sealed?: boolean | null;
  signed_by?: string | null;
  findings?: Finding[];
}

export interface ArchiveUpload {
  file: string;
}

export interface ArmErrorsFound {
  poses: number[][][];
  middle_mm: number[];
  lengths_sigma: number;
  position_sigma_mm: number;
  orientation_sigma_rad: number;
  tool_with_lengths: number[];
  tool_with_poses: number[][][];
  scanner_with_lengths: number[];
  scanner_with_poses: number[][][];
  table_with_lengths?: number[] | null;
  table_with_poses?: number[][][] | null;
}

export interface ArmJoint {
  a_mm?: number;
  alpha_deg?: number;
  d_mm?: number;
  theta_deg?: number;
  kind?: "revolute" | "prismatic";
  sign?: 1 | -1;
  name?: string | null;
  previous_from_joint?: number[][] | null;
  limits?: unknown[] | null;
}

export interface ArmModelFound {
  names: string[];
  values: number[];
  sigmas: number[];
  members?: string[];
  held_out_rms_mm: number[];
  worth_it: boolean;
  applied?: boolean;
  controller?: FoundFrame[] | null;
}

export interface ArmTable {
  joints: ArmJoint[];
  convention?: "standard" | "modified";
  couples?: Record<string, number>;
  source?: string | null;
  base_from_first?: number[][] | null;
  last_from_tool0?: number[][] | null;
}

export interface ArmText {
  xml: string;
  name?: string;
  base?: string | null;
  tip?: string | null;
}

export interface ArmWorth {
  captures: number;
  without_mm: number;
  with_mm: number;
  worth_it: boolean;
}

export interface Arming {
  mover: string;
  settings?: Record<string, unknown>;
  low_deg: number;
  high_deg: number;
  minutes?: number;
}

export interface Arms {
  items: string[];
}

export interface AskedFrame {
  name: string;
  matrix: number[][];
  covariance: number[][];
  through: string[];
  stale: boolean;
  without_covariance: string[];
}

export interface AtPoint {
  point_in_laser_mm: number[];
  covariance: number[][];
}

export interface AtWorkpiece {
  of: "tool" | "table" | "both";
  where?: string;
  point_mm: number[];
  sigmas_mm: number[];
  worst_sigma_mm: number;
}

export interface AuditEntry {
  number: number;
  at: string;
  who: string;
  role: string;
  token: string | null;
  address: string;
  method: string;
  path: string;
  outcome: "done" | "refused";
  change?: Record<string, unknown> | null;
}

export interface AuditPage {
  items: AuditEntry[];
  next: string | null;
}

export interface Axis {
  label: string;
  unit?: string;
  low?: number | null;
  high?: number | null;
}

export interface AxisDifference {
  axis: string;
  unit: "deg" | "mm";
  difference: number;
  sigma: number;
  sigmas: number | null;
}

export interface BackupUpload {
  backup: string[];
  settings?: string;
  allow?: string;
}

export interface Band {
  low: number;
  high: number;
  label: string;
}

export interface BatchAnswer {
  items: BatchItem[];
  stored: number;
}

export interface BatchItem {
  id: string | null;
  status: number;
  problem?: Problem | null;
}

export interface BeforeAfter {
  label: string;
  unit?: string;
  before: number | null;
  after: number | null;
}

export interface Board {
  kind: "chessboard" | "charuco" | "circles" | "asymmetric-circles";
  columns: number;
  rows: number;
  pitch_mm: number;
  pitch_y_mm?: number | null;
  pitch_sigma_mm?: number | null;
  margin_mm?: number | null;
  marker_mm?: number | null;
  dictionary?: string | null;
  flat?: boolean | null;
  fixed?: boolean;
}

export interface BoardsSeen {
  step: string;
  frames: number;
  covered: number;
  depth_ratio: number;
  one_distance: boolean;
}

export interface Box {
  low_mm: number[];
  high_mm: number[];
}

export interface Brand {
  name: string;
  title: string;
  conventions: string[];
  endings: string[];
  reads: boolean;
  exports: string[];
  proof: "controller" | "real files" | "manual only";
  experimental: boolean;
}

export interface Brands {
  items: Brand[];
}

export interface BudgetAtPart {
  frame: "turntable" | "laser";
  point_mm: number[];
  sigmas_mm: number[];
  known_offset_mm: number[];
  within_95_mm: number[];
  uncertainty_mm: number;
  shared_uncertainty_mm: number;
  cancelled_mm: number;
  parts: BudgetPart[];
  helps_most: string;
  stage: string;
  stale?: boolean;
  field?: FieldPoint[] | null;
}

export interface BudgetPart {
  name: "tool" | "scanner" | "camera" | "plane" | "table" | "arm" | "arm_alike" | "temperature" | "angle" | "points";
  sigma_mm: number;
  worst_sigma_mm: number;
  shared: boolean;
}

export interface ByTemperature {
  of: string;
  per_k: number;
  uncertainty: number;
  chance: number;
  found: boolean;
}

export interface CameraByRobot {
  views: number;
  pitch_factor: number;
  pitch_sigma: number;
  focal_px: number[];
  focal_sigma_px: number[];
  chance: number;
  position_sigma_mm: number;
  orientation_sigma_deg: number;
}

export interface CameraCandidate {
  model: string;
  parameters: number;
  held_out_rms_px: number;
  bent?: boolean;
}

export interface CameraCoverage {
  counts: number[][];
  covered: number;
  near_mm: number;
  far_mm: number;
  largest_tilt_rad: number;
  projection_sigma_px?: ((number | null)[])[];
}

export interface CameraResidual {
  capture: string;
  used: boolean;
  reason?: string | null;
  corners?: number;
  rms_px?: number | null;
  edge_width_px?: number | null;
  camera_from_board?: number[][] | null;
  points_px?: number[][];
  residuals_px?: number[][];
}

export interface CameraResult {
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "camera";
  model: "plain" | "rational" | "tilted" | "segmental";
  image_size: unknown[];
  camera_matrix: number[][];
  distortion: Record<string, number>;
  tilt_rad: number[];
  segments?: CameraSegment[];
  reprojection_rms_px: number;
  corner_sigma_px: number;
  parameters: string[];
  covariance: number[][];
  inflation?: number;
  tilt_correlation?: number | null;
  board_bend_mm?: number | null;
  board_shape?: SolvedBoardShape | null;
  candidates?: CameraCandidate[];
  coverage: CameraCoverage;
  by_robot?: CameraByRobot | null;
  residuals: CameraResidual[];
}

export interface CameraSegment {
  near_mm: number;
  far_mm: number;
  distortion: Record<string, number>;
}

export interface Capture {
  id: string;
  step: "camera" | "laser-plane" | "tcp" | "turntable" | "verify" | "plate" | "recheck" | "scan";
  kind: "frame" | "profile" | "cloud" | "sweep" | "center";
  files?: string[];
  pose?: number[] | null;
  table_deg?: number | null;
  axes_deg?: Record<string, unknown> | null;
  axes_mm?: Record<string, unknown> | null;
  mount?: string | null;
  center_mm?: number[] | null;
  poses?: number[][] | null;
  timestamps_s?: number[] | null;
  pose_track?: TimedPose[] | null;
  excluded?: boolean;
  excluded_because?: Excluded | null;
  included_because?: Excluded | null;
  taken?: string | null;
  clock?: "file" | "server" | "device" | "program" | "received" | null;
  environment?: Environment | null;
  side?: 1 | -1 | null;
  board_of?: string | null;
  scanner?: string | null;
  joints_deg?: (number | null)[] | null;
  joints_mm?: (number | null)[] | null;
  device_time_s?: number | null;
  active_tool?: number | string | null;
  active_frame?: number | string | null;
  moving?: boolean | null;
  source?: string | null;
  format?: string | null;
  format_settings?: Record<string, unknown> | null;
}

export interface CaptureChanges {
  excluded?: boolean | null;
  side?: 1 | -1 | null;
  table_deg?: number | null;
  mount?: string | null;
  pose?: number[] | null;
}

export interface CapturePage {
  items: StoredCapture[];
  next: string | null;
}

export interface CaptureSettings {
  automatic?: boolean;
  step?: "camera" | "laser-plane" | "tcp" | "turntable" | "verify" | "plate" | "recheck" | "scan";
  mount?: string | null;
}

export interface CaptureSource {
  name: string;
  title: string;
  settings: Record<string, unknown>;
  does: string;
  triggered: boolean;
  delivers: string[];
  extra: string | null;
}

export interface CaptureSources {
  items: CaptureSource[];
}

export interface CaptureUpload {
  record: string;
  files?: string[];
}

export interface Cell {
  id?: string | null;
  arrangement?: "scanner-on-robot" | "sphere-on-robot";
  pose_convention: "matrix" | "quaternion-xyzw" | "quaternion-wxyz" | "abb" | "kuka" | "fanuc" | "ur" | "staubli" | "kawasaki" | "mitsubishi" | "yaskawa" | "nachi" | "ros";
  sphere_diameter_mm?: number | null;
  sphere_diameter_sigma_mm?: number | null;
  sphere_class?: "certified" | "bearing" | "coated" | "turned" | null;
  scanner?: Scanner;
  scanners?: Record<string, unknown> | null;
  spheres?: Sphere[] | null;
  sphere_distances?: SphereDistance[] | null;
  axes?: CellAxis[] | null;
  robot?: Robot;
  turntable?: Turntable;
  board?: Board | null;
  known?: Known;
  merge?: MergeSettings;
  verification?: Verification;
  findings?: Record<string, "error" | "warning" | "note"> | null;
  equipment?: Equipment[] | null;
  release?: Policy | null;
  wanted_mm?: number | null;
  workpiece_in_laser_mm?: number[] | null;
  workpiece_in_turntable_mm?: number[] | null;
  limits?: Limits;
  nominal?: Nominal | null;
}

export interface CellAxis {
  name: string;
  kind: "rotary" | "linear";
  carries?: "object" | "robot";
  on?: string | null;
  direction?: 1 | -1 | null;
  sigma_deg?: number | null;
  sigma_mm?: number | null;
  encoder?: "exact" | "scale" | null;
}

export interface CellDrift {
  series: DriftSeries[];
  flags?: string[];
  trends?: string[];
  left_out?: Record<string, string>;
  within?: DriftWithin[];
}

export interface CellHistory {
  id: string;
  sessions: CellSession[];
  releases: Release[];
}

export interface CellPlan {
  reachable: boolean | null;
  wanted_mm: number | null;
  sphere: SpherePlan;
  spheres: SpherePlan[];
  distance_mm: number;
  offset_mm: number;
  where: string;
  limited_by: string;
  sentence: string;
  table?: TablePlan | null;
  arm_errors?: ArmWorth[];
  arm_sentence?: string;
}

export interface CellSession {
  id: string;
  name: string;
  created: string;
}

export interface CellSummary {
  id: string;
  sessions: number;
  newest_session: string | null;
  newest_created: string | null;
  released: Release | null;
}

export interface Cells {
  items: CellSummary[];
}

export interface Certificate {
  identifier: string;
  diameters: CertifiedDiameter[];
  equipment: Equipment;
}

export interface CertificateText {
  xml: string;
  of_sphere?: boolean;
}

export interface CertificateUpload {
  file: string;
}

export interface CertifiedDiameter {
  name: string;
  diameter_mm: number;
  sigma_mm: number | null;
  coverage_factor: number | null;
  line: number;
}

export interface ChainResult {
  base_from_turntable: number[][];
  axis_direction_in_base: number[];
  axis_point_in_base_mm: number[];
  direction: 1 | -1;
  axis_direction_covariance: number[][];
  axis_point_covariance: number[][];
  axis_direction_sigma_deg: number;
  axis_point_sigma_mm: number;
  mounts: TableMount[];
  circles?: TableCircle[];
  circles_axis_direction_in_base?: number[] | null;
  angle_sigma_deg: number;
  reading_sigma_mm?: number | null;
  encoder_scale: EncoderScaleError;
  radial_rms_mm: number;
  axial_rms_mm: number;
  angle_rms_deg: number;
  spheres?: FoundSphere[];
  axes?: FoundAxis[];
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  covariance: number[][];
  sphere_center_in_base_mm?: number[] | null;
  sphere_center_in_tool0_mm?: number[] | null;
  sphere_center_covariance: number[][];
  surface_rms_mm: number;
  leave_one_out_surface_rms_mm: number | null;
  center_scatter_rms_mm: number;
  undetermined?: Undetermined[];
  two_step: TwoStep;
  variance_components: VarianceComponents;
  scanner?: ScannerFound | string | null;
  scanner_errors?: Record<string, ScannerFound> | null;
  optics?: OpticsShift[];
  workpiece?: AtPoint | null;
  arm_errors?: ArmErrorsFound | null;
  arm_model?: ArmModelFound | null;
  confidence_95?: Record<string, number>;
  stage?: "chain";
  turntable_covariance: number[][];
  cross_covariance: number[][];
  residuals: (TcpResidual | TurntableResidual)[];
}

export interface Change {
  kind: "cell" | "added" | "removed" | "left-out" | "taken-back" | "changed" | "file";
  what: string;
  left?: string;
  right?: string;
}

export interface Changes {
  cell?: Record<string, unknown>;
  captures?: Record<string, unknown>;
}

export interface ChangesRequest {
  cell?: Record<string, unknown>;
  captures?: Record<string, unknown>;
}

export interface CheckLine {
  level: "error" | "warning" | "note";
  where: string;
  sentence: string;
}

export interface ChosenConvention {
  name: string;
  sure: boolean;
  why: string;
}

export interface CloudDeviations {
  against: "mesh" | "sphere";
  reference: string;
  counted: number;
  mean_mm: number;
  rms_mm: number;
  p95_mm: number;
  largest_mm: number;
  limit_mm: number;
  histogram: number[];
  center_mm?: number[] | null;
  diameter_mm?: number | null;
}

export interface CloudSection {
  frame: "turntable" | "base";
  axis?: "x" | "y" | "z" | null;
  at_mm: number;
  width_mm: number;
  across: string[];
  directions: number[][];
  low_mm: number[];
  high_mm: number[];
  count: number;
  points: number[][];
  deviations_mm?: (number | null)[] | null;
  nominal?: number[][] | null;
  limit_mm?: number | null;
}

export interface CloudSectionShown {
  axis?: "x" | "y" | "z";
  normal?: number[] | null;
  at_mm: number;
  keep?: "below" | "above";
}

export interface CloudShown {
  colors?: "height" | "scan" | "deviation";
  section?: CloudSectionShown | null;
  against?: "mesh" | "sphere";
  diameter_mm?: number | null;
  picked_mm?: unknown[][];
}

export interface CodeOfFinding {
  code: string;
  severity: "error" | "warning" | "note";
  text: string[];
  to_do: string[];
  values: string[];
  meaning: string;
  decided: string;
  usual_causes: string;
  since: string;
  can_be_changed: boolean;
}

export interface CodesOfFindings {
  items: CodeOfFinding[];
}

export interface Column {
  label: string;
  unit?: string;
  decimals?: number;
  align?: "left" | "right";
}

export interface Comparison {
  stage: string;
  left: Side;
  right: Side;
  shared: number;
  changes: Change[] | null;
  frames: FrameDifference[];
  figures: FigureDifference[];
  residuals: RowDifference[];
  maps?: Plot[];
}

export interface ControllerFileContent {
  brand: string;
  files: string[];
  poses: PoseOfFile[];
  tools: FrameOfFile[];
  frames: FrameOfFile[];
  skipped: SkippedPart[];
  notes: string[];
}

export interface ControllerUpload {
  files: string[];
  brand?: string;
  as_written?: boolean;
  told?: string;
}

export interface DecidedBefore {
  decision: string;
  solved?: string | null;
  left_out?: LeftOut[];
  added?: string[];
  limits?: string[];
  taken_back?: LeftOut[];
  text?: string;
}

export interface Deviation {
  rms_mm: number;
  within_95_mm: number;
  signed_mean_mm: number;
  uncertainty_mm?: number | null;
  points: number;
  counted: number;
  limit_mm: number;
  histogram: number[];
  extremes?: ExtremePoint[];
  tolerance_mm?: number | null;
  within_tolerance?: number | null;
  sections?: PartSection[];
}

export interface DeviceEntry {
  name: string;
  source: string;
  title: string;
  delivers: string[];
  settings: Record<string, unknown>;
  secrets: string[];
  connected_for: string | null;
  status: "off" | "connecting" | "live" | "silent" | "nonsense" | "lost";
  problem: string;
  fresh: boolean;
  why: string;
  since: string | null;
  readings: number;
  refused: number;
  rate_hz: number;
  model: string;
  can: string[];
}

export interface DeviceRequest {
  source: string;
  settings?: Record<string, unknown>;
  connected?: boolean;
}

export interface Devices {
  items: DeviceEntry[];
  capture: CaptureSettings;
  waits_for: string;
}

export interface DriftForecast {
  limit_mm: number;
  sessions: number;
  earliest_sessions: number;
  date?: string | null;
}

export interface DriftPoint {
  session: string;
  name: string;
  date: string;
  change: number;
  uncertainty: number;
  limit: number | null;
  flagged: boolean;
  level: number;
  outlier?: boolean;
  like?: number;
  environment?: Environment | null;
}

export interface DriftSeries {
  figure: "tool" | "tool-orientation" | "axis" | "axis-direction" | "verification" | "arm-zero";
  title: string;
  unit: "mm" | "deg";
  points: DriftPoint[];
  trend?: DriftTrend | null;
  temperature?: ByTemperature | null;
}

export interface DriftTrend {
  per_session: number;
  uncertainty: number;
  chance: number;
  sessions: number;
  found: boolean;
  cusum?: number;
  cusum_limit?: number;
  forecast?: DriftForecast | null;
}

export interface DriftWithin {
  session: string;
  name: string;
  date: string;
  drift_mm: number;
  uncertainty_mm: number;
  found: boolean;
  settled: boolean;
  sentence?: string;
}

export interface EncoderScaleError {
  error: number;
  sigma: number;
  applied: boolean;
}

export interface Environment {
  ball_c?: number | null;
  air_c?: number | null;
  arm_c?: number | null;
}

export interface Equipment {
  kind: string;
  name?: string | null;
  model?: string | null;
  serial?: string | null;
  certificate?: EquipmentCertificate | null;
  expansion_per_k?: number | null;
  reference_c?: number | null;
  register_id?: string | null;
}

export interface EquipmentCertificate {
  number?: string | null;
  laboratory?: string | null;
  issued?: string | null;
  due?: string | null;
  file?: string | null;
}

export interface EquipmentList {
  items: RegisteredEquipment[];
}

export interface EquipmentRequest {
  kind: string;
  name?: string | null;
  model?: string | null;
  serial?: string | null;
  certificate?: EquipmentCertificate | null;
  expansion_per_k?: number | null;
  reference_c?: number | null;
  register_id?: string | null;
}

export interface Excluded {
  who?: string;
  when?: string;
  why?: string | null;
}

export interface ExportFormat {
  name: string;
  title: string;
  settings: Record<string, unknown>;
  brand: string | null;
  media_type: string;
  suffix: string;
  proof: "controller" | "real files" | "manual only" | null;
  experimental: boolean;
}

export interface ExportFormats {
  items: ExportFormat[];
}

export interface ExtremePoint {
  point_mm: number[];
  deviation_mm: number;
}

export interface Facing {
  certain: boolean;
  before: number;
  behind: number;
  volume?: number | null;
  missing: number;
}

export interface FieldOfView {
  near_mm: number;
  far_mm: number;
  near_width_mm: number;
  far_width_mm?: number | null;
}

export interface FieldPoint {
  point_mm: number[];
  uncertainty_mm: number;
  shared_uncertainty_mm: number;
}

export interface Figure {
  id?: string | null;
  title?: string | null;
  detail?: boolean;
  kind?: "figure";
  label: string;
  quantity?: Quantity | null;
  text?: string | null;
  limit?: Quantity | null;
  limit_label?: string | null;
  remark?: string | null;
  headline?: boolean;
}

export interface FigureDifference {
  name: string;
  left: number | null;
  right: number | null;
}

export interface FileFormat {
  name: string;
  title: string;
  settings: Record<string, unknown>;
  endings: string[];
  kinds: string[];
  reads: boolean;
  writes: string[];
  proof: "controller" | "real files" | "manual only";
  experimental: boolean;
}

export interface FileFormats {
  items: FileFormat[];
}

export interface FilePair {
  file: number | null;
  pose: number | null;
}

export interface FileReading {
  format: string;
  kind: "profile" | "cloud";
  points: number;
  missing: number;
  grid: number[] | null;
  columns: Record<string, string>;
  unit: string;
  unit_from: string;
  sure: "stated" | "usual" | "doubtful";
  notes: string[];
  doubts: string[];
  sentence: string;
  low_mm: number[] | null;
  high_mm: number[] | null;
  preview: number[][];
  settings: Record<string, unknown>;
}

export interface FilesUpload {
  files: string[];
  told?: string;
}

export interface Finding {
  code: string;
  severity: "error" | "warning" | "note";
  captures?: string[];
  values?: Record<string, number | string>;
  text: string;
  to_do?: string;
  remedy?: RootCause | null;
  where?: string;
  each?: Record<string, Record<string, number | string>>;
  messages?: Record<string, MessageParts>;
  behind?: string | null;
}

export interface Findings {
  findings: Finding[];
  items: CheckLine[];
  blocks_solving: boolean;
}

export interface FlangeReading {
  tool0_from_tool?: number[][] | null;
  base_from_frame?: number[][] | null;
}

export interface FolderState {
  available: boolean;
  folders: string[];
  watch: Watch | null;
}

export interface FoundAxis {
  name: string;
  in: string;
  kind: "rotary" | "linear";
  axis_direction: number[];
  axis_point_mm?: number[] | null;
  direction?: 1 | -1;
  scale?: number;
  scale_sigma?: number | null;
  covariance: number[][];
}

export interface FoundFrame {
  into: string;
  outof: string;
  scanner?: string | null;
  matrix: number[][];
  covariance?: number[][] | null;
}

export interface FoundSphere {
  name: string;
  in: string;
  center_mm: number[];
  covariance: number[][];
  captures?: string[];
}

export interface Frame {
  id?: string | null;
  title?: string | null;
  detail?: boolean;
  kind?: "frame";
  name: string;
  into: string;
  outof: string;
  matrix: number[][];
  covariance?: number[][] | null;
  convention: string;
  units?: string;
  formula?: string;
  numbers?: FrameNumber[];
}

export interface FrameDifference {
  frame: string;
  angle_deg: number;
  shift_mm: number;
  axes: AxisDifference[];
  distance: number;
  degrees_of_freedom: number;
  chance: number;
  point_mm: number[];
  at_workpiece_mm: number;
  at_workpiece_sigma_mm: number;
}

export interface FrameNumber {
  label: string;
  quantity: Quantity;
}

export interface FrameOfFile {
  number: number | null;
  name: string | null;
  pose: number[];
  convention: string;
  line: number;
  file: string | null;
  moving: string | null;
}

export interface Guide {
  steps: GuideStep[];
  current: GuideNow;
  findings?: Finding[];
  last_capture?: GuideLast | null;
  coverage?: BoardsSeen[];
}

export interface GuideLast {
  capture: string;
  verdict: "pass" | "warn" | "fail";
  findings?: Finding[];
  reason?: string | null;
  to_do?: string | null;
}

export interface GuideNow {
  step: string;
  stage?: "camera" | "laser-plane" | "tcp" | "turntable" | "chain" | "hand-eye" | "verify" | "recheck" | "merge" | null;
  action: "capture" | "solve" | "review";
  instruction: string;
  why: string;
  exit: string;
  drawing: string;
  progress?: string | null;
  still_needed?: number;
  suggested_pose?: number[][] | null;
  suggested_pose_numbers?: number[] | null;
  suggested_note?: string | null;
  suggested_table_deg?: number | null;
  meter?: Meter | null;
}

export interface GuideStep {
  step: "camera" | "laser-plane" | "tcp" | "turntable" | "verify" | "scan" | "merge";
  status: "done" | "working" | "todo" | "later" | "stale" | "failing" | "known" | "not-needed";
  note?: string | null;
}

export interface HandEyeResidual {
  capture: string;
  used: boolean;
  reason?: string | null;
  angle_deg?: number | null;
  shift_mm?: number | null;
  mahalanobis?: number | null;
}

export interface HandEyeResult {
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "hand-eye";
  tool0_from_camera: number[][];
  covariance: number[][];
  base_from_board: number[][];
  board_covariance: number[][];
  pitch_factor?: number;
  pitch_sigma?: number | null;
  position_sigma_mm: number;
  orientation_sigma_deg: number;
  tool0_from_laser_by_board?: number[][] | null;
  laser_covariance?: number[][] | null;
  agreement?: Agreement | null;
  residuals?: HandEyeResidual[];
}

export interface Health {
  status: "ready" | "starting" | "degraded" | "stopping";
  version: string;
  kernels?: "ready" | "compiling";
  reasons?: Record<string, string>;
}

export interface Highlight {
  capture?: string | null;
}

export interface Job {
  id: string;
  session: string;
  stage: string;
  status: "queued" | "running" | "done" | "failed" | "cancelled";
  progress: number;
  message: string;
  error: Problem | null;
  created: string;
  finished: string | null;
}

export interface JobPage {
  items: Job[];
  next: string | null;
}

export interface KeptFile {
  name: string;
  bytes: number;
  sha256: string;
}

export interface KeptFiles {
  items: KeptFile[];
}

export interface Known {
  camera?: KnownCamera | null;
  laser_plane?: KnownPlane | null;
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  base_from_turntable?: number[][] | null;
  frames?: KnownFrame[] | null;
}

export interface KnownCamera {
  camera_matrix: number[][];
  distortion?: Record<string, number>;
  image_size?: unknown[] | null;
  segments?: CameraSegment[];
}

export interface KnownFrame {
  into: string;
  outof: string;
  scanner?: string | null;
  matrix: number[][];
  covariance?: number[][] | null;
}

export interface KnownPlane {
  normal: number[];
  distance_mm: number;
}

export interface LaserPlaneResidual {
  capture: string;
  used: boolean;
  reason?: string | null;
  points?: number;
  line_rms_mm?: number | null;
  line_mean_mm?: number | null;
  stripe_sigma_px?: number | null;
  board_sigma_px?: number | null;
  board_distance_mm?: number | null;
}

export interface LaserPlaneResult {
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "laser-plane";
  plane_in_camera: PlaneInCamera;
  camera_from_laser: number[][];
  plane_rms_mm: number;
  covariance: number[][];
  plane_covariance: number[][];
  camera?: RefinedCamera | null;
  joint_parameters?: string[];
  joint_covariance: number[][];
  normal_sigma_deg: number;
  distance_sigma_mm: number;
  residuals: LaserPlaneResidual[];
}

export interface LayerChange {
  name: string;
  shown: boolean;
}

export interface LayerShown {
  name: string;
  title: string;
  shown: boolean;
}

export interface LeftInFiles {
  tool: number[];
  scanner: number[];
  turntable?: number[] | null;
}

export interface LeftOut {
  capture: string;
  because?: Excluded | null;
}

export interface LikelyColumns {
  order: number[];
  spread_mm: number;
  told_spread_mm: number;
}

export interface LikelyConvention {
  convention: string;
  spread_mm: number;
  told_spread_mm?: number | null;
}

export interface LimitChange {
  at: string;
  who?: string;
  why?: string | null;
  field: string;
  before_mm?: number | null;
  after_mm?: number | null;
  captures: number;
}

export interface Limits {
  reach?: Box | null;
  tilt_deg?: number | null;
  turn_deg?: number | null;
  no_go?: Box[];
  clearance_mm?: number | null;
}

export interface ListedFrame {
  name: string;
  state: "measured" | "known" | "solved" | "sought";
  source: string;
  scanner?: string | null;
  stale?: boolean;
  matrix?: number[][] | null;
  covariance?: number[][] | null;
}

export interface LoginRequest {
  token: string;
}

export interface MadeToken {
  id: string;
  name: string;
  role: "read" | "capture" | "release" | "admin";
  created: string;
  expires: string | null;
  revoked: string | null;
  token: string | null;
}

export interface MadeWebhook {
  id: string;
  url: string;
  name: string;
  events: ("capture" | "result" | "verdict" | "job" | "session" | "release" | "verify-fail" | "drift" | "overdue" | "device-lost" | "job-failed" | "disk")[];
  cell: string | null;
  created: string;
  disabled: string | null;
  secret: string;
}

export interface Me {
  name: string;
  role: "read" | "capture" | "release" | "admin" | null;
  login: "token" | "cookie" | "not-needed" | "missing";
}

export interface Measured {
  capture: string;
  kind: "frame" | "profile" | "cloud" | "sweep" | "center";
  verdict: "pass" | "warn" | "fail";
  findings?: Finding[];
  reason?: string | null;
  to_do?: string | null;
  points?: number;
  on_sphere?: number;
  without_ray?: number;
  center_mm?: number[] | null;
  radius_mm?: number | null;
  rms_mm?: number | null;
  point_sigma_mm?: number | null;
  points_per_independent?: number | null;
  covariance?: number[][] | null;
  zone?: number | null;
  extent_deg?: number | null;
  preview?: number[][];
  preview_on_sphere?: boolean[];
  image_size?: unknown[] | null;
  board_px?: number[][];
  pitch_px?: number | null;
  edge_width_px?: number | null;
  profiles?: number | null;
  still?: Still | null;
}

export interface MeasuredClocks {
  offset_s: number;
  sigma_s: number;
  rms_mm: number;
  exposures: number;
  clocks: string;
  shift_at_100_mm_s_mm: number;
  warning: string;
}

export interface MergeResidual {
  capture: string;
  used: boolean;
  reason?: string | null;
  points?: number;
  kept?: number;
  stray?: number;
  mixed?: number;
  grazing?: number;
  overlap_pairs?: number;
  overlap_mean_mm?: number | null;
  overlap_rms_mm?: number | null;
  expected_overlap_rms_mm?: number | null;
  shift_mm?: number | null;
  turn_deg?: number | null;
  cloud_from_laser?: number[][] | null;
}

export interface MergeResult {
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "merge";
  frame: "turntable" | "base";
  cloud: string | null;
  points: number;
  scanned_points: number;
  voxel_mm: number;
  spills?: number;
  overlap_rms_mm: number | null;
  expected_overlap_rms_mm: number | null;
  overlap_expected_mm?: number | null;
  overlap_pairs: number;
  normals_outward?: string | null;
  facing?: Facing | null;
  pose_scatter?: PoseScatter | null;
  registered_overlap_rms_mm?: number | null;
  registration_shift_rms_mm?: number | null;
  self_calibration?: SharedShift | null;
  surface_sigma_mm?: number | null;
  calibrated_by?: string | null;
  base_from_turntable?: number[][] | null;
  mesh: string | null;
  triangles?: number;
  mesh_open_edges?: number | null;
  low_mm: number[];
  high_mm: number[];
  alignment?: Alignment | null;
  deviation?: Deviation | null;
  residuals: MergeResidual[];
}

export interface MergeSettings {
  voxel_mm?: number;
  mesh?: "poisson" | "grid" | "none";
  holes?: "leave" | "fill" | null;
  mesh_tolerance_mm?: number | null;
  registration?: boolean;
  self_calibration?: boolean;
  memory_mb?: number;
  reference?: string | null;
  alignment?: PartAlignment | null;
  tolerance_mm?: number | null;
}

export interface MessageParts {
  template: string;
  values?: Record<string, unknown>;
  many?: string;
  by?: string;
}

export interface Meter {
  uncertainty_mm: number | null;
  wanted_mm?: number | null;
  after_next_mm?: number | null;
  still_needed?: number | null;
  enough?: boolean;
  stated?: boolean;
  history?: MeterPoint[];
}

export interface MeterPoint {
  capture: string;
  uncertainty_mm: number | null;
}

export interface MomentChange {
  place: number;
}

export interface MomentOfSession {
  place: number;
  session: Session;
  captures: StoredCapture[];
  results: Record<string, StoredCameraResult | StoredLaserPlaneResult | StoredTcpResult | StoredTurntableResult | StoredChainResult | StoredHandEyeResult | StoredVerifyResult | StoredRecheckResult | StoredMergeResult>;
  numbers: Record<string, number>;
  guide: Guide;
  frames: Record<string, unknown> | null;
}

export interface MountedScanner {
  kind?: "frame" | "profile" | "cloud" | "sweep" | "center" | null;
  point_sigma_mm?: number | null;
  z_axis?: "away" | "toward" | null;
  errors?: "cover" | "apply" | null;
  field_of_view?: FieldOfView | null;
  pitch_mm?: number | null;
  on?: "tool0" | "base";
}

export interface MoverChoice {
  name: string;
  title: string;
  does: string;
  extra: string | null;
  settings: Record<string, unknown>;
}

export interface Movers {
  items: MoverChoice[];
}

export interface Nominal {
  tool0_from_laser?: number[][] | null;
  tool_sigma_mm?: number | null;
  tool_sigma_deg?: number | null;
  sphere_center_in_base_mm?: number[] | null;
  base_from_tool0?: number[][] | null;
  base_from_turntable?: number[][] | null;
}

export interface Note {
  id?: string | null;
  title?: string | null;
  detail?: boolean;
  kind?: "note";
  text: string;
  level?: "pass" | "warn" | "fail" | "info";
}

export interface OffTheTruth {
  frames: FrameDifference[];
}

export interface OldSession {
  id: string;
  name: string;
  cell: string;
  updated: string;
  revision: number;
  size: number;
  why: "age" | "quota";
}

export interface OldSessions {
  items: OldSession[];
}

export interface OpticsShift {
  source: "camera" | "plane";
  tool: number[];
  turntable?: number[] | null;
  scanner: number[];
  at_mm: number[];
  point_mm: number[];
  by_place: number[][];
}

export interface PartAlignment {
  method?: "none" | "best-fit" | "3-2-1" | "matrix";
  base_from_reference?: number[][] | null;
  datum_points_mm?: number[][] | null;
  datum_radius_mm?: number;
}

export interface PartSection {
  axis: "x" | "y" | "z";
  at_mm: number;
  magnified: number;
  nominal: number[][];
  points: number[][];
}

export interface PastResult {
  number: number;
  created: string;
  stage: string;
  verdict: "pass" | "warn" | "fail";
  method: string;
  software: string;
  inputs_sha256: string;
  captures: number;
  used: number;
  figures: Record<string, number>;
}

export interface Picture {
  id?: string | null;
  title?: string | null;
  detail?: boolean;
  kind?: "picture";
  drawing?: string | null;
  capture?: string | null;
  file?: string | null;
  alt: string;
}

export interface PlaneInCamera {
  normal: number[];
  distance_mm: number;
}

export interface PlannedCell {
  scanner: FieldOfView;
  point_sigma_mm?: number;
  pitch_mm?: number;
  kind?: "profile" | "cloud" | "center";
  arm?: "calibrated" | "ordinary" | "nominal";
  arm_name?: string | null;
  position_sigma_mm?: number | null;
  mounting_mm?: number;
  sphere_diameter_mm?: number | null;
  sphere_class?: "certified" | "bearing" | "coated" | "turned";
  limits?: Limits;
  wanted_mm?: number | null;
  table?: TableToPlan | null;
  most_captures?: number;
}

export interface PlannedPose {
  id: string;
  pose: number[];
}

export interface Plot {
  id?: string | null;
  title?: string | null;
  detail?: boolean;
  kind?: "plot";
  shape: "captures" | "line" | "xy" | "histogram" | "grid" | "section";
  caption: string;
  x: Axis;
  y: Axis;
  series: Series[];
  band?: Band | null;
}

export interface Policy {
  needs?: "verify"[];
  interval_days?: number | null;
  four_eyes?: boolean;
}

export interface PoseConventionEntry {
  name: string;
  title: string;
  settings: Record<string, unknown>;
  brand: string | null;
  numbers: string[];
  units: string;
  formula: string;
}

export interface PoseConventions {
  items: PoseConventionEntry[];
}

export interface PoseLine {
  line: number;
  text: string;
  numbers?: (number | null)[] | null;
  matrix?: number[][] | null;
  problem?: string | null;
}

export interface PoseLines {
  items: PoseLine[];
  likely_convention?: LikelyConvention | null;
  likely_columns?: LikelyColumns | null;
}

export interface PoseList {
  step?: "tcp" | "turntable" | "verify";
  pose_convention: string;
  speed_mm_s: number;
  poses: PoseOfSet[];
  note: string;
}

export interface PoseOfFile {
  name: string;
  pose: number[] | null;
  matrix: number[][] | null;
  convention: string;
  joints_deg: number[] | null;
  external: Record<string, number> | null;
  tool: number | string | null;
  frame: number | string | null;
  line: number;
  file: string | null;
  as_written: number[] | null;
  doubt: string | null;
  time_s: number | null;
}

export interface PoseOfSet {
  base_from_tool0: number[][];
  numbers: number[];
  approach_numbers: number[] | null;
  uncertainty_mm: number | null;
  table_deg?: number | null;
  mount?: string | null;
  higher_mm?: number | null;
}

export interface PoseReading {
  convention: string;
  mm_per_unit: number;
  radians: boolean;
  way: "as-written" | "inverted" | "transposed" | "columns";
}

export interface PoseScatter {
  position_sigma_mm: number;
  orientation_sigma_deg: number;
  surface_sigma_mm: number;
}

export interface PoseText {
  text: string;
  convention?: string | null;
}

export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  need: string;
  got: string;
  to_do: string;
  where: string;
}

export interface ProgramEntry {
  name: string;
  title: string;
  convention: string;
  needs: string;
  proof: "controller" | "real files" | "manual only";
  experimental: boolean;
}

export interface ProgramRequest {
  host: string;
  port: number;
  token?: string;
  step?: "camera" | "laser-plane" | "tcp" | "turntable" | "verify" | "plate" | "recheck" | "scan";
  mount?: string | null;
  poses?: PlannedPose[] | null;
  speed_mm_s?: number;
  approach_mm?: number;
}

export interface Quantity {
  value: number | null;
  unit?: string;
  uncertainty?: number | null;
  decimals?: number;
}

export interface ReasonGiven {
  reason: string;
  values: Record<string, string | number>;
  why: string;
}

export interface RecheckPlan {
  pose_convention: string;
  poses: RepeatedPose[];
  still_needed: number;
}

export interface RecheckResidual {
  capture: string;
  used: boolean;
  reason?: string | null;
  repeats?: string | null;
  round?: number | null;
  change_mm?: number | null;
  expected_mm?: number | null;
  mahalanobis?: number | null;
  pose_distance_mm?: number | null;
  pose_turn_deg?: number | null;
}

export interface RecheckResult {
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "recheck";
  rechecked: string;
  holds: boolean;
  changed: "nothing" | "tool" | "sphere" | "tool-or-sphere" | "unclear";
  change_mm: number;
  uncertainty_mm: number;
  rounds?: RecheckRound[];
  residuals: RecheckResidual[];
}

export interface RecheckRound {
  captures: string[];
  change_mm: number;
  uncertainty_mm: number;
  change_in_laser_mm: number[];
  chance: number;
  changed: "nothing" | "tool" | "sphere" | "tool-or-sphere" | "unclear";
  sentence: string;
}

export interface RecognisedFile {
  reason: string;
  values: Record<string, string | number>;
  why: string;
  name: string;
  taken_for: "profiles" | "clouds" | "frames" | "boards" | "centers" | "poses" | "backup" | "certificate" | "session" | "nothing";
  preview: number[][];
}

export interface RecognisedFiles {
  files: RecognisedFile[];
  poses: RecognisedPose[];
  pairs: FilePair[];
  paired_by: "name" | "number" | "time" | "order" | null;
  convention: ChosenConvention | null;
  sphere_diameter_mm: number | null;
  sphere_from: string | null;
  doubts: ReasonGiven[];
  missing: ReasonGiven[];
}

export interface RecognisedPose {
  name: string;
  pose: number[];
  file: string;
  line: number;
  time_s: number | null;
  joints_deg: number[] | null;
  table_deg: number | null;
  doubt: string | null;
}

export interface Recomputed {
  replay: Replay;
  stages: Record<string, Comparison>;
}

export interface ReferenceMesh {
  triangles: number;
  low_mm: number[];
  high_mm: number[];
  sha256: string;
}

export interface ReferenceUpload {
  file: string;
}

export interface RefinedCamera {
  model: "plain" | "rational" | "tilted" | "segmental";
  image_size: unknown[];
  camera_matrix: number[][];
  distortion: Record<string, number>;
  segments?: CameraSegment[];
}

export interface RefusedFile {
  file: string;
  reason: string;
}

export interface RegisteredEquipment {
  kind: string;
  name?: string | null;
  model?: string | null;
  serial?: string | null;
  certificate?: EquipmentCertificate | null;
  expansion_per_k?: number | null;
  reference_c?: number | null;
  register_id?: string | null;
  id: string;
  created: string;
  updated: string;
  overdue: boolean;
}

export interface Release {
  number: number;
  cell: string;
  session: string;
  action: "release" | "rollback";
  who: string;
  why: string;
  created: string;
  verdict: "pass" | "warn" | "fail";
  solved: string | null;
  inputs_sha256: Record<string, string>;
  workpiece_sigma_mm: number | null;
}

export interface ReleaseRequest {
  why?: string;
  allow?: string;
}

export interface RepeatedPose {
  capture: string;
  pose: number[];
  base_from_tool0: number[][];
  captured?: string | null;
}

export interface Replay {
  session: string;
  software: string;
  tolerance: number;
  equal: boolean;
  stages: StageReplay[];
}

export interface ReplayDifference {
  path: string;
  stored?: unknown;
  fresh?: unknown;
  relative?: number | null;
}

export interface ResultHistory {
  items: PastResult[];
}

export interface Robot {
  position_sigma_mm?: number | null;
  orientation_sigma_deg?: number | null;
  brand?: string | null;
  arm?: string | ArmTable | null;
  errors?: "cover" | "apply" | null;
}

export interface RobotLine {
  at: string;
  peer: string;
  heard: string;
  said: string;
}

export interface RobotPort {
  open: boolean;
  host: string | null;
  port: number | null;
  allowed: string[];
  peers: string[];
  lines: RobotLine[];
}

export interface RobotPortSettings {
  host?: string;
  port?: number;
  allowed?: string[];
}

export interface RobotPrograms {
  items: ProgramEntry[];
}

export interface Rollback {
  why?: string;
  number?: number | null;
  allow?: string;
}

export interface RootCause {
  id: string;
  kind: "pose-reading" | "swapped-poses" | "shifted-poses" | "moved-sphere" | "changed-tool" | "sphere-diameter" | "point-unit" | "scaled-profile" | "table-direction" | "table-angles" | "not-the-flange" | "scan-elsewhere" | "scanner-axis" | "pose-list-order";
  title?: string;
  sentence?: string;
  evidence?: BeforeAfter[];
  captures?: string[];
  changes?: Changes | null;
  pose_reading?: PoseReading | null;
  poses_from?: Record<string, string>;
  table_reading?: TableReading | null;
  point_settings?: Record<string, unknown>;
  flange_reading?: FlangeReading | null;
}

export interface RootCauses {
  items: RootCause[];
}

export interface Row {
  cells: (string | number | Quantity | null)[];
  capture?: string | null;
  used?: boolean;
  reason?: string | null;
}

export interface RowDifference {
  capture: string;
  left_used?: boolean | null;
  right_used?: boolean | null;
  left_reason?: string | null;
  right_reason?: string | null;
  left?: Record<string, number | null>;
  right?: Record<string, number | null>;
}

export interface Scanner {
  kind?: "frame" | "profile" | "cloud" | "sweep" | "center" | null;
  point_sigma_mm?: number | null;
  z_axis?: "away" | "toward" | null;
  errors?: "cover" | "apply" | null;
  field_of_view?: FieldOfView | null;
  pitch_mm?: number | null;
}

export interface ScannerFileUpload {
  file: string;
  kind?: "profile" | "cloud" | null;
  format?: string;
  settings?: string;
}

export interface ScannerFound {
  names: string[];
  values: number[];
  sigmas: number[];
  covariance: number[][];
  covariance_with_tool: number[][];
  applied: boolean;
  sphere_diameter_sigma_mm: number;
  covariance_with_table?: number[][] | null;
  half_width_mm?: number | null;
  facing?: number;
  left_in_files?: LeftInFiles | null;
  sheet_bend_mm?: number | null;
}

export interface SceneControls {
  views: string[];
  layers: LayerShown[];
}

export interface SentPing {
  id: string;
}

export interface Series {
  label?: string;
  x?: number[];
  y: (number | null)[];
  captures?: string[];
  reasons?: (string | null)[];
}

export interface Session {
  format?: "scancell-session/1";
  name?: string;
  archived?: boolean;
  documentation?: Record<string, string> | null;
  environment?: Environment | null;
  cell: Cell;
  captures?: Capture[];
}

export interface SessionAnswer {
  format?: string;
  session: string;
  cell: string;
  stage: string;
  verdict: "pass" | "warn" | "fail";
  stale: boolean;
  faults: string[];
  findings?: Finding[];
  warnings: string[];
  undetermined: unknown[];
  solved: string | null;
  software: string;
  inputs_sha256: Record<string, string>;
  pose_convention: string;
  names: string[];
  units: string;
  tool0_from_laser: AnsweredFrame | null;
  base_from_laser?: AnsweredFrame | null;
  base_from_turntable: AnsweredFrame | null;
  position_sigma_mm: number;
  rotation_sigma_deg: number;
  budget?: unknown;
  decision?: string | null;
  limits_changed?: string[];
  workpiece_sigma_mm?: number | null;
  verified?: string | null;
  decided_before?: DecidedBefore[];
  equipment?: Equipment[];
}

export interface SessionChanges {
  name?: string | null;
  archived?: boolean | null;
  cell?: Record<string, unknown> | null;
  why?: string | null;
}

export interface SessionDrift {
  moved: "scanner" | "sphere" | "scanner-or-sphere";
  drift_mm: number;
  uncertainty_mm: number;
  found: boolean;
  settled: boolean;
  over_s?: number | null;
  settling_s?: number | null;
  again?: string[];
  sentence?: string;
  points?: SessionDriftPoint[];
}

export interface SessionDriftPoint {
  capture: string;
  at_s: number | null;
  offset_mm: number;
  sigma_mm: number;
  course_mm: number;
}

export interface SessionFrames {
  session: string;
  capture?: string | null;
  scanner?: string | null;
  edges: ListedFrame[];
  asked?: AskedFrame | null;
}

export interface SessionPage {
  items: SessionSummary[];
  next: string | null;
}

export interface SessionRequest {
  format?: "scancell-session/1";
  name?: string;
  cell?: Cell | null;
  simulated?: SimulatedCell | null;
}

export interface SessionSummary {
  id: string;
  name: string;
  created: string;
  updated: string;
  cell: Cell;
  cell_id: string;
  capture_count: number;
  archived: boolean;
  verdicts: Record<string, "pass" | "warn" | "fail">;
  stale: ("camera" | "laser-plane" | "tcp" | "turntable" | "chain" | "hand-eye" | "verify" | "recheck" | "merge")[];
}

export interface SharedShift {
  directions: number;
  shift: number[];
  covariance: number[][];
}

export interface ShotRequest {
  id?: string | null;
  pose?: number[] | null;
  table_deg?: number | null;
}

export interface Side {
  session: string;
  name?: string;
  number?: number | null;
  created?: string | null;
  verdict: string;
  method: string;
  software: string;
  inputs_sha256: string;
}

export interface SimulatedCell {
  scenario?: string;
  seed?: number;
}

export interface SkippedPart {
  line: number;
  reason: string;
  file: string | null;
}

export interface SolvedBoardShape {
  coefficients_mm: number[];
  extent_mm: number[][];
}

export interface Sphere {
  name: string;
  diameter_mm?: number | null;
  diameter_sigma_mm?: number | null;
  on?: string | null;
}

export interface SphereDistance {
  between: string[];
  mm: number;
  sigma_mm?: number | null;
}

export interface SpherePlan {
  diameter_mm: number;
  captures: number | null;
  uncertainty_mm: number;
  after_mm: (number | null)[];
}

export interface StageOfCell {
  name: string;
  title: string;
  settings: Record<string, unknown>;
  steps: string[];
  after: string[];
  guided: string[];
  planned: boolean;
  is_answer: boolean;
  step: StepOfCaptures | null;
  further_steps: StepOfCaptures[];
  settings_field: string | null;
  layers: string[];
  element: string | null;
}

export interface StageReplay {
  stage: string;
  equal: boolean;
  numbers?: number;
  largest_relative?: number;
  difference_count?: number;
  differences?: ReplayDifference[];
  why?: string[];
  provenance?: "replayed" | "differs" | null;
  finding?: Finding | null;
}

export interface StagesOfCell {
  items: StageOfCell[];
}

export interface StepOfCaptures {
  name: string;
  title: string;
  shows: string;
  to_capture: string;
}

export interface Still {
  exposures: number;
  movement_mm: number;
  noise_mm: number;
  chance: number;
  stands_still: boolean;
}

export interface StoredCameraResult {
  stale: boolean;
  at_workpiece?: AtWorkpiece[];
  turned_deg?: Record<string, number>;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "camera";
  model: "plain" | "rational" | "tilted" | "segmental";
  image_size: unknown[];
  camera_matrix: number[][];
  distortion: Record<string, number>;
  tilt_rad: number[];
  segments?: CameraSegment[];
  reprojection_rms_px: number;
  corner_sigma_px: number;
  parameters: string[];
  covariance: number[][];
  inflation?: number;
  tilt_correlation?: number | null;
  board_bend_mm?: number | null;
  board_shape?: SolvedBoardShape | null;
  candidates?: CameraCandidate[];
  coverage: CameraCoverage;
  by_robot?: CameraByRobot | null;
  residuals: CameraResidual[];
}

export interface StoredCapture {
  id: string;
  step: "camera" | "laser-plane" | "tcp" | "turntable" | "verify" | "plate" | "recheck" | "scan";
  kind: "frame" | "profile" | "cloud" | "sweep" | "center";
  files?: string[];
  pose?: number[] | null;
  table_deg?: number | null;
  axes_deg?: Record<string, unknown> | null;
  axes_mm?: Record<string, unknown> | null;
  mount?: string | null;
  center_mm?: number[] | null;
  poses?: number[][] | null;
  timestamps_s?: number[] | null;
  pose_track?: TimedPose[] | null;
  excluded?: boolean;
  excluded_because?: Excluded | null;
  included_because?: Excluded | null;
  taken?: string | null;
  clock?: "file" | "server" | "device" | "program" | "received" | null;
  environment?: Environment | null;
  side?: 1 | -1 | null;
  board_of?: string | null;
  scanner?: string | null;
  joints_deg?: (number | null)[] | null;
  joints_mm?: (number | null)[] | null;
  device_time_s?: number | null;
  active_tool?: number | string | null;
  active_frame?: number | string | null;
  moving?: boolean | null;
  source?: string | null;
  format?: string | null;
  format_settings?: Record<string, unknown> | null;
  measured: Measured;
}

export interface StoredChainResult {
  stale: boolean;
  at_workpiece?: AtWorkpiece[];
  turned_deg?: Record<string, number>;
  base_from_turntable: number[][];
  axis_direction_in_base: number[];
  axis_point_in_base_mm: number[];
  direction: 1 | -1;
  axis_direction_covariance: number[][];
  axis_point_covariance: number[][];
  axis_direction_sigma_deg: number;
  axis_point_sigma_mm: number;
  mounts: TableMount[];
  circles?: TableCircle[];
  circles_axis_direction_in_base?: number[] | null;
  angle_sigma_deg: number;
  reading_sigma_mm?: number | null;
  encoder_scale: EncoderScaleError;
  radial_rms_mm: number;
  axial_rms_mm: number;
  angle_rms_deg: number;
  spheres?: FoundSphere[];
  axes?: FoundAxis[];
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  covariance: number[][];
  sphere_center_in_base_mm?: number[] | null;
  sphere_center_in_tool0_mm?: number[] | null;
  sphere_center_covariance: number[][];
  surface_rms_mm: number;
  leave_one_out_surface_rms_mm: number | null;
  center_scatter_rms_mm: number;
  undetermined?: Undetermined[];
  two_step: TwoStep;
  variance_components: VarianceComponents;
  scanner?: ScannerFound | string | null;
  scanner_errors?: Record<string, ScannerFound> | null;
  optics?: OpticsShift[];
  workpiece?: AtPoint | null;
  arm_errors?: ArmErrorsFound | null;
  arm_model?: ArmModelFound | null;
  confidence_95?: Record<string, number>;
  stage?: "chain";
  turntable_covariance: number[][];
  cross_covariance: number[][];
  residuals: (TcpResidual | TurntableResidual)[];
}

export interface StoredCloudFile {
  name: string;
  bytes: number;
  sha256: string;
  formats: string[];
}

export interface StoredCloudFiles {
  items: StoredCloudFile[];
}

export interface StoredHandEyeResult {
  stale: boolean;
  at_workpiece?: AtWorkpiece[];
  turned_deg?: Record<string, number>;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "hand-eye";
  tool0_from_camera: number[][];
  covariance: number[][];
  base_from_board: number[][];
  board_covariance: number[][];
  pitch_factor?: number;
  pitch_sigma?: number | null;
  position_sigma_mm: number;
  orientation_sigma_deg: number;
  tool0_from_laser_by_board?: number[][] | null;
  laser_covariance?: number[][] | null;
  agreement?: Agreement | null;
  residuals?: HandEyeResidual[];
}

export interface StoredLaserPlaneResult {
  stale: boolean;
  at_workpiece?: AtWorkpiece[];
  turned_deg?: Record<string, number>;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "laser-plane";
  plane_in_camera: PlaneInCamera;
  camera_from_laser: number[][];
  plane_rms_mm: number;
  covariance: number[][];
  plane_covariance: number[][];
  camera?: RefinedCamera | null;
  joint_parameters?: string[];
  joint_covariance: number[][];
  normal_sigma_deg: number;
  distance_sigma_mm: number;
  residuals: LaserPlaneResidual[];
}

export interface StoredMergeResult {
  stale: boolean;
  at_workpiece?: AtWorkpiece[];
  turned_deg?: Record<string, number>;
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "merge";
  frame: "turntable" | "base";
  cloud: string | null;
  points: number;
  scanned_points: number;
  voxel_mm: number;
  spills?: number;
  overlap_rms_mm: number | null;
  expected_overlap_rms_mm: number | null;
  overlap_expected_mm?: number | null;
  overlap_pairs: number;
  normals_outward?: string | null;
  facing?: Facing | null;
  pose_scatter?: PoseScatter | null;
  registered_overlap_rms_mm?: number | null;
  registration_shift_rms_mm?: number | null;
  self_calibration?: SharedShift | null;
  surface_sigma_mm?: number | null;
  calibrated_by?: string | null;
  base_from_turntable?: number[][] | null;
  mesh: string | null;
  triangles?: number;
  mesh_open_edges?: number | null;
  low_mm: number[];
  high_mm: number[];
  alignment?: Alignment | null;
  deviation?: Deviation | null;
  residuals: MergeResidual[];
}

export interface StoredRecheckResult {
  stale: boolean;
  at_workpiece?: AtWorkpiece[];
  turned_deg?: Record<string, number>;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "recheck";
  rechecked: string;
  holds: boolean;
  changed: "nothing" | "tool" | "sphere" | "tool-or-sphere" | "unclear";
  change_mm: number;
  uncertainty_mm: number;
  rounds?: RecheckRound[];
  residuals: RecheckResidual[];
}

export interface StoredSession {
  format?: "scancell-session/1";
  name?: string;
  archived?: boolean;
  documentation?: Record<string, string> | null;
  environment?: Environment | null;
  cell: Cell;
  captures?: Capture[];
  id: string;
  created: string;
  updated: string;
  revision: number;
  scene: string;
  simulated: boolean;
}

export interface StoredTcpResult {
  stale: boolean;
  at_workpiece?: AtWorkpiece[];
  turned_deg?: Record<string, number>;
  spheres?: FoundSphere[];
  axes?: FoundAxis[];
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  covariance: number[][];
  sphere_center_in_base_mm?: number[] | null;
  sphere_center_in_tool0_mm?: number[] | null;
  sphere_center_covariance: number[][];
  surface_rms_mm: number;
  leave_one_out_surface_rms_mm: number | null;
  center_scatter_rms_mm: number;
  undetermined?: Undetermined[];
  two_step: TwoStep;
  variance_components: VarianceComponents;
  scanner?: ScannerFound | string | null;
  scanner_errors?: Record<string, ScannerFound> | null;
  optics?: OpticsShift[];
  workpiece?: AtPoint | null;
  arm_errors?: ArmErrorsFound | null;
  arm_model?: ArmModelFound | null;
  confidence_95?: Record<string, number>;
  stage?: "tcp";
  warm_up?: SessionDrift | null;
  residuals: TcpResidual[];
}

export interface StoredTurntableResult {
  stale: boolean;
  at_workpiece?: AtWorkpiece[];
  turned_deg?: Record<string, number>;
  spheres?: FoundSphere[];
  axes?: FoundAxis[];
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  base_from_turntable: number[][];
  axis_direction_in_base: number[];
  axis_point_in_base_mm: number[];
  direction: 1 | -1;
  axis_direction_covariance: number[][];
  axis_point_covariance: number[][];
  axis_direction_sigma_deg: number;
  axis_point_sigma_mm: number;
  mounts: TableMount[];
  circles?: TableCircle[];
  circles_axis_direction_in_base?: number[] | null;
  angle_sigma_deg: number;
  reading_sigma_mm?: number | null;
  encoder_scale: EncoderScaleError;
  radial_rms_mm: number;
  axial_rms_mm: number;
  angle_rms_deg: number;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "turntable";
  covariance: number[][];
  undetermined?: Undetermined[];
  variance_components: VarianceComponents;
  residuals: TurntableResidual[];
}

export interface StoredVerifyResult {
  stale: boolean;
  at_workpiece?: AtWorkpiece[];
  turned_deg?: Record<string, number>;
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "verify";
  verified: string;
  sphere_center_in_base_mm: number[] | null;
  sphere_center_in_tool0_mm?: number[] | null;
  sphere_center_covariance: number[][] | null;
  surface_rms_mm: number | null;
  held_out_scatter_rms_mm: number | null;
  expected_scatter_rms_mm: number | null;
  chi_squared: number | null;
  degrees_of_freedom: number;
  chance: number | null;
  checks?: VerifyCheck[];
  decision?: "pass" | "conditional-pass" | "undecided" | "conditional-fail" | "fail" | null;
  limits_changed?: string[];
  residuals: VerifyResidual[];
}

export interface StoryChange {
  step: string;
  side?: "measure" | "result";
}

export interface StoryShown {
  open: boolean;
  view: string;
  layers: Record<string, boolean>;
  subject: string[];
}

export interface SweepRequest {
  id?: string | null;
  seconds: number;
  table_deg?: number | null;
}

export interface Table {
  id?: string | null;
  title?: string | null;
  detail?: boolean;
  kind?: "table";
  caption?: string;
  columns: Column[];
  rows: Row[];
}

export interface TableCircle {
  mount: string;
  center_in_base_mm: number[];
  normal_in_base: number[];
  radius_mm: number;
  circle_rms_mm: number;
  plane_rms_mm: number;
  captures: string[];
}

export interface TableLayout {
  radius_mm: number;
  heights_mm: number[];
  angles: number;
  captures: number;
  uncertainty_mm: number;
}

export interface TableMount {
  mount: string;
  center_in_turntable_mm: number[];
  radius_mm: number;
  captures: number;
}

export interface TableMover {
  armed: boolean;
  mover: string | null;
  low_deg: number | null;
  high_deg: number | null;
  seconds_left: number;
  target_deg: number | null;
}

export interface TablePlan {
  reachable: boolean | null;
  layout: TableLayout;
  layouts: TableLayout[];
  sentence: string;
}

export interface TableReading {
  factor?: number;
  offset_deg?: number;
  since?: string | null;
}

export interface TableToPlan {
  radius_mm?: number;
  height_mm?: number;
  angle_sigma_deg?: number;
  most_angles?: number;
}

export interface TableTurn {
  table_deg: number;
}

export interface TakenShot {
  id: string;
  verdict: string;
  zone: number | null;
  text: string;
}

export interface TcpResidual {
  capture: string;
  used: boolean;
  reason?: string | null;
  points?: number;
  surface_rms_mm?: number | null;
  center_distance_mm?: number | null;
  center_offset_in_base_mm?: number[] | null;
  center_offset_in_tool0_mm?: number[] | null;
  leave_one_out_rms_mm?: number | null;
  two_step_surface_rms_mm?: number | null;
  mahalanobis?: number | null;
  weight?: number | null;
  side?: number | null;
  zone?: number | null;
  shift_without_mm?: number | null;
  turn_without_deg?: number | null;
  growth_without?: number | null;
  profiles?: number | null;
  profiles_used?: number | null;
}

export interface TcpResult {
  spheres?: FoundSphere[];
  axes?: FoundAxis[];
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  covariance: number[][];
  sphere_center_in_base_mm?: number[] | null;
  sphere_center_in_tool0_mm?: number[] | null;
  sphere_center_covariance: number[][];
  surface_rms_mm: number;
  leave_one_out_surface_rms_mm: number | null;
  center_scatter_rms_mm: number;
  undetermined?: Undetermined[];
  two_step: TwoStep;
  variance_components: VarianceComponents;
  scanner?: ScannerFound | string | null;
  scanner_errors?: Record<string, ScannerFound> | null;
  optics?: OpticsShift[];
  workpiece?: AtPoint | null;
  arm_errors?: ArmErrorsFound | null;
  arm_model?: ArmModelFound | null;
  confidence_95?: Record<string, number>;
  stage?: "tcp";
  warm_up?: SessionDrift | null;
  residuals: TcpResidual[];
}

export interface TimedPose {
  t_s: number;
  pose: number[];
}

export interface Timeline {
  items: TimelineItem[];
}

export interface TimelineItem {
  place: number;
  kind: "capture" | "result" | "limit" | "failed" | "cancelled" | "now";
  at: string;
  capture?: string | null;
  step?: "camera" | "laser-plane" | "tcp" | "turntable" | "verify" | "plate" | "recheck" | "scan" | null;
  removed?: boolean;
  stage?: string | null;
  number?: number | null;
  verdict?: "pass" | "warn" | "fail" | null;
  software?: string | null;
  message?: string | null;
  excluded_because?: Excluded | null;
  included_because?: Excluded | null;
}

export interface TokenRecord {
  id: string;
  name: string;
  role: "read" | "capture" | "release" | "admin";
  created: string;
  expires: string | null;
  revoked: string | null;
}

export interface TokenRecords {
  items: TokenRecord[];
}

export interface TokenRequest {
  name: string;
  role: "read" | "capture" | "release" | "admin";
  days?: number | null;
}

export interface ToolComparison {
  equal: boolean;
  words: string;
  position_mm: number | null;
  rotation_deg: number | null;
  faults: string[];
}

export interface ToolUpload {
  files?: string[];
  tool?: string;
  brand?: string;
  numbers?: string;
  convention?: string;
}

export interface Trial {
  poses: number[][][];
}

export interface Turn {
  capture?: string | null;
}

export interface Turned {
  table_deg: number;
}

export interface Turntable {
  direction?: 1 | -1 | null;
  angle_sigma_deg?: number | null;
  encoder?: "exact" | "scale" | null;
  angles?: "read" | "unknown" | null;
}

export interface TurntableResidual {
  capture: string;
  used: boolean;
  reason?: string | null;
  mount?: string | null;
  table_deg?: number | null;
  points?: number;
  surface_rms_mm?: number | null;
  center_distance_mm?: number | null;
  radial_mm?: number | null;
  tangential_mm?: number | null;
  axial_mm?: number | null;
  angle_deg?: number | null;
  center_in_base_mm?: number[] | null;
  mahalanobis?: number | null;
  side?: number | null;
  profiles?: number | null;
  profiles_used?: number | null;
}

export interface TurntableResult {
  spheres?: FoundSphere[];
  axes?: FoundAxis[];
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  base_from_turntable: number[][];
  axis_direction_in_base: number[];
  axis_point_in_base_mm: number[];
  direction: 1 | -1;
  axis_direction_covariance: number[][];
  axis_point_covariance: number[][];
  axis_direction_sigma_deg: number;
  axis_point_sigma_mm: number;
  mounts: TableMount[];
  circles?: TableCircle[];
  circles_axis_direction_in_base?: number[] | null;
  angle_sigma_deg: number;
  reading_sigma_mm?: number | null;
  encoder_scale: EncoderScaleError;
  radial_rms_mm: number;
  axial_rms_mm: number;
  angle_rms_deg: number;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "turntable";
  covariance: number[][];
  undetermined?: Undetermined[];
  variance_components: VarianceComponents;
  residuals: TurntableResidual[];
}

export interface TwoResults {
  stage: "camera" | "laser-plane" | "tcp" | "turntable" | "chain" | "hand-eye" | "verify" | "recheck" | "merge";
  left: string;
  right: string;
}

export interface TwoStep {
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  sphere_center_in_base_mm?: number[] | null;
  sphere_center_in_tool0_mm?: number[] | null;
  surface_rms_mm?: number | null;
  leave_one_out_surface_rms_mm?: number | null;
  center_scatter_rms_mm?: number | null;
  covariance?: number[][] | null;
  translations?: string[][];
  reason?: string | null;
}

export interface Undetermined {
  direction: number[];
  description: string;
}

export interface UpToShift {
  directions: number[][];
  travel?: number[] | null;
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  base_from_turntable?: number[][] | null;
  covariance: number[][];
  turntable_covariance?: number[][] | null;
  cross_covariance?: number[][] | null;
}

export interface VarianceComponents {
  point_sigma_mm: number | null;
  position_sigma_mm: number;
  orientation_sigma_rad: number;
  orientation_sigma_deg: number;
  estimated?: string[];
  alike_position_sigma_mm?: number;
  alike_orientation_sigma_rad?: number;
  reach_mm?: number;
  reach_rad?: number;
  points_per_independent?: number;
}

export interface Verification {
  tool_mm?: number | null;
  form_mm?: number | null;
  form_95_mm?: number | null;
  size_mm?: number | null;
  spacing_mm?: number | null;
  flatness_mm?: number | null;
  flatness_95_mm?: number | null;
  ball_bar_mm?: number | null;
  ball_bar_sigma_mm?: number | null;
  changes?: LimitChange[] | null;
}

export interface VerifyCheck {
  name: string;
  title: string;
  value_mm: number;
  uncertainty_mm: number;
  limit_mm?: number | null;
  decision?: "pass" | "conditional-pass" | "undecided" | "conditional-fail" | "fail" | null;
  reason?: string;
}

export interface VerifyResidual {
  capture: string;
  used: boolean;
  reason?: string | null;
  points?: number;
  surface_rms_mm?: number | null;
  center_offset_in_base_mm?: number[] | null;
  center_distance_mm?: number | null;
  expected_center_distance_mm?: number | null;
  mahalanobis?: number | null;
  side?: number | null;
  zone?: number | null;
  profiles?: number | null;
  plane_offset_mm?: number | null;
}

export interface VerifyResult {
  tool0_from_laser?: number[][] | null;
  base_from_laser?: number[][] | null;
  up_to_shift?: UpToShift | null;
  method: string;
  method_revision?: number;
  software: string;
  inputs_sha256: string;
  verdict: "pass" | "warn" | "fail";
  pose_convention?: string | null;
  solved?: string | null;
  provenance?: "solved" | "imported" | "replayed" | "differs" | null;
  seal?: Record<string, unknown> | null;
  findings?: Finding[];
  warnings?: string[];
  notes?: string[];
  causes?: RootCause[];
  frames?: FoundFrame[];
  evidence?: (Figure | Frame | Table | Plot | Picture | Note)[];
  stage?: "verify";
  verified: string;
  sphere_center_in_base_mm: number[] | null;
  sphere_center_in_tool0_mm?: number[] | null;
  sphere_center_covariance: number[][] | null;
  surface_rms_mm: number | null;
  held_out_scatter_rms_mm: number | null;
  expected_scatter_rms_mm: number | null;
  chi_squared: number | null;
  degrees_of_freedom: number;
  chance: number | null;
  checks?: VerifyCheck[];
  decision?: "pass" | "conditional-pass" | "undecided" | "conditional-fail" | "fail" | null;
  limits_changed?: string[];
  residuals: VerifyResidual[];
}

export interface ViewChange {
  view: string;
  if_open?: boolean;
}

export interface Watch {
  folder: string;
  step: "camera" | "laser-plane" | "tcp" | "turntable" | "verify" | "plate" | "recheck" | "scan";
  taken: number;
  waiting: string[];
  refused: RefusedFile[];
  problem: string;
}

export interface WatchedFolder {
  folder: string;
  step?: "camera" | "laser-plane" | "tcp" | "turntable" | "verify" | "plate" | "recheck" | "scan";
}

export interface Webhook {
  id: string;
  url: string;
  name: string;
  events: ("capture" | "result" | "verdict" | "job" | "session" | "release" | "verify-fail" | "drift" | "overdue" | "device-lost" | "job-failed" | "disk")[];
  cell: string | null;
  created: string;
  disabled: string | null;
}

export interface WebhookDeliveries {
  items: WebhookDelivery[];
  next: string | null;
}

export interface WebhookDelivery {
  number: number;
  event: string;
  payload: Record<string, unknown>;
  status: "waiting" | "delivered" | "failed";
  attempts: number;
  due: string | null;
  answered: number | null;
  error: string | null;
  created: string;
  finished: string | null;
}

export interface WebhookRequest {
  url: string;
  name?: string;
  events?: ("capture" | "result" | "verdict" | "job" | "session" | "release" | "verify-fail" | "drift" | "overdue" | "device-lost" | "job-failed" | "disk")[];
  cell?: string | null;
}

export interface Webhooks {
  items: Webhook[];
}
