/** What the server and the editor say to each other: the generated messages, and the look document they carry. */
import type * as gen from "./protocol.gen";

export type {
  BakeBody,
  BakeMessage,
  BakeRequest,
  BuiltInBody,
  ClientMessage,
  CurveBody,
  CurveMessage,
  DryRunBody,
  EnvironmentBody,
  FrameHeader,
  HelloMessage,
  LookEntry,
  MaterialMapBody,
  ModelBody,
  ParameterBody,
  PlanBody,
  ProbeAnswer,
  Problem,
  ProblemMessage,
  RenderBody,
  RenderRequest,
  ServerMessage,
  ShareEntry,
  ShareRequest,
  StatusMessage,
  TruthBody,
  TruthPlanBody,
  TruthRequest,
} from "./protocol.gen";
export { MAX_MESSAGE_BYTES, MAX_VIEWS_SHOWN, SUBPROTOCOL } from "./protocol.gen";

export type Rgb = [number, number, number];
export type Triple = [x: number, y: number, z: number];
export type ParamValue = number | Rgb;
export type Point = [degrees: number, value: number];
export type Handle = [degrees: number, was: number, becomes: number];
export type Tile = [x: number, y: number, width: number, height: number];
export type PatchOp = gen.PatchOperation;

/** A curve by `points` or `bands`, or a change to these or to what the parameters give by the other three. */
export interface CurveOverride {
  points?: Point[];
  bands?: number[] | number[][];
  factors?: number[] | number[][];
  offsets?: number[] | number[][];
  handles?: Handle[];
  channels?: string;
}
export type CurveEdits = CurveOverride | CurveOverride[];

export interface Term {
  model: string;
  data?: string;
  color: Rgb;
  params?: Record<string, ParamValue>;
  texture?: string | null;
  curves?: Record<string, CurveEdits>;
}
export interface MaterialLook {
  terms: Term[];
  /** Of a ground alone: only shadows on it are shown. */
  catcher?: boolean;
}
/** What is seen where no surface is; it lights nothing. `color` is radiance, `blur` degrees. */
export interface Background {
  kind: "map" | "blurred" | "color" | "transparent";
  color: Rgb;
  blur: number;
}
export type Fidelity = gen.FrameHeader["fidelity"];

export interface Look {
  materials: Record<string, MaterialLook>;
  /** `map` names an environment of the server, null the scene's own. */
  environment: { map?: string | null; scale: number; color: Rgb; rotation: number };
  background: Background;
  lights: Record<string, Light>;
  /** Which light paths are shown; `bounces` between surfaces. */
  transport: Transport;
  display: { exposure: number; tone_map: string };
}
interface AnyLight {
  scale: number;
  color: Rgb;
  on: boolean;
  emission: Rgb;
}
/** Directions need not be unit; degrees, metres. */
export type Light = AnyLight &
  (
    | { kind: "point"; position: Triple }
    | { kind: "spot"; position: Triple; direction: Triple; cone: [inner: number, outer: number] }
    | { kind: "directional"; direction: Triple }
    | { kind: "rectangle"; position: Triple; direction: Triple; rotation: number; size: [width: number, height: number] }
    | { kind: "mesh"; material: string }
  );
export type LightKind = Light["kind"];
export interface Transport {
  show: "all" | "direct" | "first_bounce" | "further_bounces";
  bounces: number;
}

/** A library material, its terms in look-document form. */
export type MeasuredBody = Omit<gen.MeasuredBody, "terms"> & { terms: Term[] };
export type MaterialBody = Omit<gen.MaterialBody, "terms"> & { terms: Term[] };

/** What a link carries; its look is complete. */
export type ShareBody = Omit<gen.ShareBody, "look"> & { look: Look };

/** A scene, its default terms in look-document form. */
export type SceneBody = Omit<gen.SceneBody, "materials"> & { materials: { name: string; terms: Term[]; catcher: boolean }[] };
