/** Types of the protocol: the generated messages and look document, with the editor's type names. */
import type * as doc from "./look.gen";
import type * as gen from "./protocol.gen";

export type {
  BakeBody,
  BakeMessage,
  BakeRequest,
  BtfJobBody,
  ExampleSceneBody,
  ColorBody,
  CameraEntry,
  CommentBody,
  CommentRequest,
  ClientMessage,
  CurveBody,
  CurveMessage,
  DryRunBody,
  EnvironmentBody,
  ExportedMaterial,
  ExportReportBody,
  ExportRequest,
  IesBody,
  ImageBody,
  ImportOptions,
  ViewportBody,
  FrameHeader,
  FreeCameraError,
  HelloMessage,
  LensBody,
  AlbedoBody,
  ZernikeFitBody,
  ZernikeFitRequest,
  LooksRequest,
  LookEntry,
  LookView,
  LooksBody,
  LutBody,
  MaterialMapBody,
  MeBody,
  OpenMessage,
  ModelBody,
  ParameterBody,
  PickBody,
  Person,
  PlanBody,
  InspectAnswer,
  PathAnswer,
  PathBody,
  Problem,
  PrincipledParameters,
  PrincipledRequest,
  PrincipledTermsRequest,
  ProblemMessage,
  RenderBody,
  MixedLookBody,
  RenderPlanBody,
  RenderRequest,
  RoomMessage,
  SceneView,
  ServerMessage,
  ShareEntry,
  ShareRequest,
  ShortfallBody,
  SolveBody,
  SolveRequest,
  StrokeBody,
  RoomUpdate,
  SyntheticBtfRequest,
  StatusMessage,
  FreeCameraBody,
  ComparisonBody,
  ComparisonPlanBody,
  ComparisonRequest,
  Turntable,
} from "./protocol.gen";
export type {
  BackgroundLook as Background,
  DrawnCurve,
  LightLook as Light,
  OcioView,
  TransportLook as Transport,
} from "./look.gen";
export {
  FIDELITIES,
  LUT_GAIN,
  LUT_SIZE,
  MAX_COMMENT,
  MAX_CAMERA_PIXELS,
  MAX_MESSAGE_BYTES,
  MAX_PERSON_NAME,
  MAX_VISIBLE_VIEWS,
  ROOM_PREFIX,
  SUBPROTOCOL,
  PROBES_LAYOUT,
} from "./protocol.gen";

export type Rgb = [number, number, number];
export type Triple = [x: number, y: number, z: number];
export type Point = [degrees: number, value: number];
export type Handle = [degrees: number, was: number, becomes: number];
export type Tile = [x: number, y: number, width: number, height: number];
export type PatchOp = gen.PatchOperation;

export type Fidelity = gen.Fidelity;

/** A partial term: omitted fields have their model's defaults. */
export type Term = Pick<doc.TermLook, "model" | "color"> & Partial<doc.TermLook>;
export type ParamValue = doc.TermLook["params"][string];
export type CurveEdits = doc.TermLook["curves"][string];
export interface MaterialLook extends Omit<doc.MaterialLook, "terms"> {
  terms: Term[];
}
export interface Look extends Omit<doc.Look, "materials"> {
  materials: Record<string, MaterialLook>;
}
export type LightKind = doc.LightLook["kind"];

/** A library material, its terms in look-document form. */
export type MeasuredBody = Omit<gen.MeasuredBody, "terms"> & { terms: Term[] };
export type MetalnessBody = Omit<gen.MetalnessBody, "terms"> & { terms: Term[] };
export type LibraryMaterialBody = Omit<gen.LibraryMaterialBody, "terms" | "normal_map" | "glass"> & {
  terms: Term[];
  normal_map: MaterialLook["normal_map"];
  glass: MaterialLook["glass"];
};
export type ImportedBody = Omit<gen.ImportedBody, "materials"> & { materials: LibraryMaterialBody[] };
export type BtfBody = Omit<gen.BtfBody, "terms"> & { terms: Term[] };
export type PrincipledTermsBody = { terms: Term[]; glass: MaterialLook["glass"] };
export type PrincipledBody = Omit<gen.PrincipledBody, keyof PrincipledTermsBody> & PrincipledTermsBody;
export type MaterialBody = Omit<gen.MaterialBody, "terms"> & { terms: Term[] };

/** A shared state; its look is complete. */
export type ShareBody = Omit<gen.ShareBody, "look"> & { look: Look };

/** A scene, its default terms in look-document form. */
export type SceneMaterial = Omit<gen.SceneMaterial, "terms"> & { terms: Term[] };
export type SceneBody = Omit<gen.SceneBody, "materials"> & { materials: SceneMaterial[] };
