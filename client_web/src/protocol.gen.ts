// Written by `python -m relume_server.typescript` from the server's models. Do not edit.


export const SUBPROTOCOL = "relume.v2";

export const MAX_MESSAGE_BYTES = 65536;

export const MAX_FRAMES_IN_FLIGHT = 2;

export const MAX_VISIBLE_VIEWS = 4;

export const MAX_CAMERA_PIXELS = 2304000;

export const PROBES_LAYOUT = 4;

export const MAX_PERSON_NAME = 40;

export const ROOM_PREFIX = 8;

export const MAX_COMMENT = 2000;

export const LUT_SIZE = 65;

export const LUT_GAIN = 9;

/** Worst first. */
export const FIDELITIES: Fidelity[] = ["preview", "approximate", "incremental", "near_exact", "exact"];

/** client → server: this frame was received and displayed. */
export interface AckMessage {
  type: "ack";
  frame: number;
}

/** A bake to queue. The preset gives size and lights; explicit fields override it. `aspect`: width ÷ height of the image with as many pixels as the preset's; ignored with `size`. `views`: names of the scene's cameras, or cameras, which become part of the recipe; default: all cameras of the file. `probes`: surface probes of a free camera (method `probes`); refused for fixed cameras. `patches`: surface patches of indirect light; `gather_rays`: per view sample or probe; by default both fit the image size (methods `gather` and `probes`). `relightable`: tile the environment so that rotating or replacing it causes little error. */
export interface BakeRequest {
  scene: string;
  method?: string;
  views?: (string | CameraBody)[] | null;
  preset?: "preview" | "good" | "final" | null;
  aspect?: number | null;
  size?: [number, number] | null;
  lights?: number | null;
  probes?: number | null;
  patches?: number | null;
  gather_rays?: number | null;
  relightable?: boolean;
  dry_run?: boolean;
}

/** A view of a bake; `bake` null: that of the request. */
export interface BakeView {
  view: string;
  bake?: string | null;
}

/** A camera that a user placed, by name. */
export interface CameraBody {
  to_world: number[];
  yfov: number;
  near?: number;
  lens?: LensBody | null;
  name: string;
}

/** Pose and field of view of a camera. `to_world`: camera to world, 16 numbers, row by row, looking along -Z; scale is removed. `yfov`: vertical, degrees. `near`: distance of the near clipping plane, meters; light and shadows are those of the whole scene. */
export interface CameraFrame {
  to_world: number[];
  yfov: number;
  near?: number;
}

/** client → server: move the "free" camera of a view, with this image size; the latest message counts, and frames repeat its `seq` as `camera_seq`. `to_world`, row by row, `yfov` and `near` as in `CameraInfo`. `active_control`: as in an edit; nothing is prepared for it. `refine`: "exact": an exact image follows when the camera stops, and edits continue in it; "none": none follows. */
export interface CameraMessage {
  type: "camera";
  view: string;
  seq: number;
  to_world: number[];
  yfov: number;
  near?: number;
  size: [number, number];
  active_control?: string | null;
  refine?: "exact" | "none";
}

/** Interpolate cameras, spaced evenly over the frames, or as the looks if there are equally many; one frame each if no number of frames is given. */
export interface CameraPath {
  cameras: CameraFrame[];
}

/** Resolve or reopen a comment. */
export interface CommentChange {
  resolved: boolean;
}

/** Pin a comment to a pixel. `x`, `y`: pixel of the image of `view` at `size`, from its upper left corner. `camera`: free camera of the view, if any. `text`: plain. `author`: used if the server has no login. `picture`: snapshot, a PNG, JPEG or WebP in Base64, at most 1024 pixels a side. */
export interface CommentRequest {
  bake: string;
  view: string;
  x: number;
  y: number;
  size: [number, number];
  camera?: CameraFrame | null;
  text: string;
  author?: string | null;
  picture?: string | null;
}

/** Compare a look with the reference, in so many passes; errors are available from the second pass on. `paths`: "all" compares with all light paths of the scene, and with those of the bake's method; "method" only with the latter, which is faster. For a free camera: `camera` and `size` of the image; by default as baked. */
export interface ComparisonRequest {
  bake: string;
  view: string;
  look?: Record<string, unknown>;
  camera?: CameraFrame | null;
  size?: [number, number] | null;
  paths?: "all" | "method";
  passes?: number;
  dry_run?: boolean;
}

/** client → server: change the look; `revision` must be newer than the last. `active_control` is the control that is dragged: a curve, or a `parameter` as in `PrepareMessage`, in the look after the edit; null for all other edits. `solo` lists the lights, local ones and "environment", that are shown alone from now on, without being part of the look; null: all; left out: unchanged. An edit with `solo` may have an empty patch. */
export interface EditMessage {
  type: "edit";
  revision: number;
  patch: PatchOperation[];
  active_control?: string | null;
  solo?: string[] | null;
}

/** client → server: encoding of images. "auto": HDR, but JPEG while moving if the connection is too slow for it. "png": displayed images without loss, as batch renders have them. */
export interface EncodingMessage {
  type: "encoding";
  format: "hdr" | "jpeg" | "png" | "auto";
  quality?: number;
}

/** A scene with a look as a file. `look`: a look document, may be partial. `saved_look`: the name of a saved look, instead. `variants`: names of further saved looks, whose materials the file offers as variants. `format` "light_mix": JSON with brightness and color of lights by name, itself accepted as a look. */
export interface ExportRequest {
  format?: "glb" | "materialx" | "usd" | "light_mix";
  look?: Record<string, unknown>;
  saved_look?: string | null;
  variants?: string[];
}

/** client → server: the pointer is in this visible view: its frames and operators have priority. */
export interface FocusMessage {
  type: "focus";
  view: string;
}

/** client → server: show the pixels that a curve's interval affects; each visible view answers "highlight". */
export interface HighlightMessage {
  type: "highlight_curve_range";
  curve: string;
  from: number;
  to: number;
}

/** client → server: read a pixel of a visible view, by default the focused one; see `InspectAnswer`. */
export interface InspectMessage {
  type: "inspect";
  view?: string | null;
  x: number;
  y: number;
}

/** Depth of field: `radius` of the aperture and depth that is sharp, meters; `blades` of a polygon, 0: round. */
export interface LensBody {
  radius: number;
  focus_distance: number;
  blades?: number;
}

/** Request the look of each frame of an animation; `view`: of the `path`. */
export interface LooksRequest {
  bake: string;
  looks: Record<string, unknown>[];
  frames?: number | null;
  durations?: number[] | null;
  interpolation?: "parameters" | "map" | "map_low";
  path?: Turntable | CameraPath | null;
  view?: string | null;
}

/** client → server: first message, sent once. All fields are optional; null is the same as leaving them out. `room`, or `view_token` for a view-only link, is the id of the room to join; the URL then has its first eight characters as `room_prefix`. `participant_token`: of this client in the room. `name`: display name if the server has no login. `share`, or `look`: the shared or saved look to start with. `resume`: token of a lost session. */
export interface OpenMessage {
  type: "open";
  room?: string | null;
  view_token?: string | null;
  participant_token?: string | null;
  name?: string | null;
  share?: string | null;
  look?: string | null;
  resume?: string | null;
}

/** One operation of a JSON Patch (RFC 6902) on the look. */
export interface PatchOperation {
  op: "replace" | "add" | "remove" | "test";
  path: string;
  value?: unknown;
}

/** client → server: find the first surface on a path of a "free" camera; see `PathAnswer`. `id` is repeated. */
export interface PathMessage {
  type: "path";
  id: number;
  points: [number, number, number][];
}

/** client → server: keep-alive. Answered by a `PongMessage` at once, whatever is being computed. */
export interface PingMessage {
  type: "ping";
}

/** client → server: announce an edit. Either of `curve`: precompute it and send its `CurveMessage` from now on; or of `parameter`, also a light (/lights/NAME) or a field of the environment: prepare it; the open curve stays open. */
export interface PrepareMessage {
  type: "prepare";
  curve?: string | null;
  parameter?: string | null;
}

/** client → server: own name, if the server has no login (left out: unchanged), and selected material. */
export interface PresenceMessage {
  type: "presence";
  name?: string | null;
  material?: string | null;
}

/** Terms and glass of a material's look. `scene` and `material` name the material of a scene whose textures the terms use; without them, its textures count as white. */
export interface PrincipledRequest {
  terms: Record<string, unknown>[];
  glass?: Record<string, unknown> | null;
  scene?: string | null;
  material?: string | null;
}

/** Principled `parameters`, omitted ones with their defaults, and the material's own `terms` and `glass`, whose textures and absorption stay. `texture_means`: as returned with the parameters. */
export interface PrincipledTermsRequest {
  terms: Record<string, unknown>[];
  parameters: Record<string, unknown>;
  glass?: Record<string, unknown> | null;
  texture_means?: TextureMeansBody | null;
}

/** A reference picture: `image`, the file in base64. PNG, JPEG and WebP have display values, from which exposure and tone mapping of the look are removed; HDR and OpenEXR have linear radiance. `fit_exposure`: only its relative brightness counts. */
export interface ReferenceBody {
  image: string;
  fit_exposure?: boolean;
}

/** client → server: visible region of a view with a "fixed" camera: x, y, width, height in pixels of its image. It is computed first, approximate frames contain only its tiles, and `fidelity` refers to it. null: the whole image, the default. */
export interface RegionMessage {
  type: "region";
  view: string;
  rect: [number, number, number, number] | null;
}

/** A batch of exact images; looks may be partial, and light mixes. `looks` are documents, `look_names` their names, and `saved_looks` names of saved looks, after them. `view` is the view of `bake`; `views`, instead, are several, also of other bakes: all looks are rendered in each. `size`: at most the baked one, the default; any for a free camera. `name`: of downloads; default: scene and view. `file_name`: name of each image with fields, such as "{scene}_{view}_{look}.{frame:04}.exr"; fields are `scene`, `bake`, `view`, `look` and `frame`, a number with up to 9 digits. Frames, or looks without `frames` and `path`, are numbered from `start_frame`; of an animation only each `frame_step`-th is rendered, and has its number. `saved_views`: render each saved look in the view saved with it, and the others in `view`. `rebake`: if a bake with fixed cameras has another size than `size`, bake its views with this size first. `dry_run`: check everything, queue nothing, and return names and cost. `priority`: among renders of the same user, higher ones first. `webhook`: address that gets a signed message when the render has ended, see docs/operations.md. Only for EXR: `layers`, true for one per light and per light path, or "light_groups" for direct and indirect light of each light, which add up to the image; `aovs`: depth, position, normals, texture coordinates, albedo, emission, and Cryptomattes of objects and materials; `precision` of the values; and `color_space`, a linear one of the server's OpenColorIO config (GET /api/color), by default linear Rec. 709. For animations: `path` and `frames`, see POST /api/renders/looks. `format` "mp4" makes a video with `fps` frames per second, "contact_sheet" one PNG of all images with their names. `quality`: "interactive" renders a free camera as it looks while moving, about a hundred times faster. */
export interface RenderRequest {
  bake: string;
  looks?: Record<string, unknown>[];
  frames?: number | null;
  durations?: number[] | null;
  interpolation?: "parameters" | "map" | "map_low";
  path?: Turntable | CameraPath | null;
  look_names?: string[];
  saved_looks?: string[];
  view?: string | null;
  views?: BakeView[];
  format: "exr" | "png" | "webp" | "mp4" | "contact_sheet";
  size?: [number, number] | null;
  saved_views?: boolean;
  rebake?: boolean;
  dry_run?: boolean;
  name?: string | null;
  file_name?: string | null;
  start_frame?: number;
  frame_step?: number;
  priority?: number;
  webhook?: string | null;
  layers?: boolean | "light_groups";
  aovs?: boolean;
  precision?: "half" | "float";
  color_space?: string | null;
  fps?: number;
  quality?: "exact" | "interactive";
}

/** client → server: who renders views with a "free" camera while they move. "client": from now on frames of kind "scene_update" contain the shader inputs that GET /api/bakes/{id}/probes does not, each when it changes; moving the camera sends no frame. Exact images are sent as before. */
export interface RendererMessage {
  type: "renderer";
  renderer: "client" | "server";
}

/** Content of a share link: a look of a bake, the views side by side, and the focused one. `solo`, `solo_light`: the material or the light ("" is the environment) that is shown alone. `paths`: visible light paths; null: those of the look. `cameras`: free cameras by view; `sizes`: image sizes in pixels by view, if not the baked size. */
export interface ShareRequest {
  bake: string;
  view: string;
  views: string[];
  look: Record<string, unknown>;
  solo?: string | null;
  solo_light?: string | null;
  paths?: SharedPaths | null;
  cameras?: Record<string, CameraFrame>;
  sizes?: Record<string, [number, number]>;
}

/** Visible light paths; as a look's `transport`. */
export interface SharedPaths {
  show: "all" | "direct" | "indirect" | "first_bounce" | "further_bounces";
  bounces: number;
}

/** Find the lights of a look from its image. `look`: a look document, may be partial. `camera` and `size`: of a bake with a free camera, by default the view's. Without strokes, the whole image is to look as the `reference`. `locked`: JSON pointers of lights that stay, such as `/lights/Key` or `/environment`. `change`: intensities alone, or colors, too; by default colors, too, unless all strokes are `brighter` or `darker`. `rotate`: the environment may rotate, which renders it about 25 times. `materials`: names of materials whose colors and parameters may change; at most 12 steps, each of which renders an image of each light and one of each number. */
export interface SolveRequest {
  bake: string;
  view: string;
  look?: Record<string, unknown>;
  camera?: CameraFrame | null;
  size?: [number, number] | null;
  strokes?: StrokeBody[];
  reference?: ReferenceBody | null;
  locked?: string[];
  change?: "intensity" | "color" | null;
  rotate?: boolean;
  materials?: string[];
}

/** A stroke of a brush over the image: `brighter` or `darker` by `stops`; in a `color` (linear Rec. 709) at equal luminance; or as the `reference` picture there. `points`: a line in pixels, from the left and from the top of the image, with a brush of `radius` pixels. `mask`: instead, a gray PNG of the image in base64, white where the stroke is. */
export interface StrokeBody {
  kind: "brighter" | "darker" | "color" | "reference";
  points?: [number, number][];
  radius?: number;
  mask?: string | null;
  stops?: number;
  color?: [number, number, number];
}

/** A synthetic BTF to render from a small geometry, `size` texels wide. */
export interface SyntheticBtfRequest {
  geometry: "weave" | "pebbles" | "corduroy";
  size?: number;
  error?: number;
  name?: string | null;
}

/** Terms, as in a look. */
export interface TermsRequest {
  terms: Record<string, unknown>[];
}

/** Mean of the texture of each channel, linear RGB; ones without a texture. */
export interface TextureMeansBody {
  diffuse: [number, number, number];
  specular: [number, number, number];
}

/** One revolution about a vertical axis, in so many frames; `start_camera`: of the first frame, by default the view's. `pivot`: a point on the axis, meters; by default the center of the first image, at the depth of its surface. `rotate`: the `camera`; or the `object`, with fixed camera, environment and lights; or the `environment` alone, which needs no free camera. */
export interface Turntable {
  turntable: number;
  start_camera?: CameraFrame | null;
  pivot?: number[] | null;
  rotate?: "camera" | "object" | "environment";
}

/** client → server: show this view alone. `size` is the client's area in pixels: JPEGs are scaled down to it until the next such message; all other frames have the baked size. */
export interface ViewMessage {
  type: "view";
  name: string;
  size?: [number, number] | null;
}

/** client → server: show these views side by side; edits apply to all. */
export interface ViewsMessage {
  type: "views";
  names: string[];
}

/** All terms of a material, and the `basis_functions` of its look. */
export interface ZernikeFitRequest {
  terms: Record<string, unknown>[];
  basis_functions?: 1 | 3 | 6 | 10 | 15 | 21 | 28 | 36 | null;
}

/** Albedo of a material with white textures: `mean` over all view directions, and the `max` in any channel, at `max_angle_degrees` from the normal. */
export interface AlbedoBody {
  mean: number[];
  max: number;
  max_angle_degrees: number;
}

/** An array of a payload or of GET /api/bakes/{id}/probes: number of texels, each of 1, 2 or 4 numbers. */
export interface ArrayInfo {
  name: string;
  dtype: "float32" | "float16" | "uint32" | "int32";
  shape: [number, number];
}

/** A bake; `progress` 0…1, `problem` is a sentence if it failed or had to restart. `phase`: current step, for `phase_seconds` already. `queue_position`: number of bakes before a queued one. `is_current`: made by the server's own code version (`code`); older bakes can be used, but might differ if they were baked again. `user`: who submitted it first, `created`: when. */
export interface BakeBody {
  id: string;
  user: string;
  created: string;
  scene: string;
  state: "queued" | "running" | "ready" | "failed" | "canceled";
  progress: number;
  phase: "starting" | "loading" | "reading" | "building" | "compiling" | "sampling" | "tracing" | "publishing" | null;
  phase_seconds: number | null;
  queue_position: number;
  rays_per_second: number | null;
  seconds_left: number | null;
  bytes: number;
  problem: string | null;
  code: string | null;
  is_current: boolean;
  recipe: RecipeBody;
  plan: PlanBody | null;
}

/** server → client: another bake of the scene is running or ready; to use it, open a session and send the look. */
export interface BakeMessage {
  type: "bake";
  bake: string;
  replaces: string;
  state: string;
  progress: number;
  phase: "starting" | "loading" | "reading" | "building" | "compiling" | "sampling" | "tracing" | "publishing" | null;
  seconds_left: number | null;
}

/** A BTF; looks refer to it by `data`, `terms` are its initial terms. `synthetic` describes the geometry that it was rendered from; null if it was measured. `error` is the relative RMS of the compression by number of components, starting with none; `ratio` is the compression ratio. It takes `memory_bytes` while it is shown. */
export interface BtfBody {
  id: string;
  data: string;
  name: string;
  created: string;
  terms: Record<string, unknown>[];
  thumbnail: string;
  synthetic: string | null;
  size: [number, number];
  directions: number;
  clusters: number;
  components: number;
  error: number[];
  ratio: number;
  memory_bytes: number;
}

/** A BTF job. `material`: its id when ready. `geometry`: null for uploaded images. `user`: who requested it; `created`, `started` and `ended` are times; null: not yet. */
export interface BtfJobBody {
  id: string;
  name: string;
  user: string;
  geometry: "weave" | "pebbles" | "corduroy" | "mesh" | null;
  state: "queued" | "running" | "ready" | "failed" | "canceled";
  created: string;
  started: string | null;
  ended: string | null;
  progress: number;
  seconds_left: number | null;
  material: string | null;
  problem: string | null;
}

/** A camera of a scene; `is_placed`: placed by a user, not from the scene's file. */
export interface CameraEntry {
  to_world: number[];
  yfov: number;
  near: number;
  lens: LensBody | null;
  name: string;
  is_placed: boolean;
}

/** A camera that looks along its -Z. `to_world`: 4 × 4, row by row, rigid, meters. `yfov`: vertical, radians. `near`: distance of the near clipping plane, meters. */
export interface CameraInfo {
  to_world: number[];
  yfov: number;
  near: number;
}

/** OpenColorIO config of the server; all fields are null or empty without one. `id` changes with the config; `default`: its default view; `working`: its name of linear Rec. 709; `spaces`: its linear color spaces, for EXR files. */
export interface ColorBody {
  id: string | null;
  name: string | null;
  working: string | null;
  displays: DisplayBody[];
  default: ViewBody | null;
  spaces: string[];
}

/** A comment. `picture`: URL of the snapshot, relative to the server, null if there is none. */
export interface CommentBody {
  id: string;
  bake: string;
  view: string;
  x: number;
  y: number;
  size: [number, number];
  camera: CameraFrame | null;
  text: string;
  author: string;
  created: string;
  resolved: boolean;
  resolved_by: string | null;
  picture: string | null;
}

/** server → client: a comment of the scene was added, resolved or deleted; read the list again. */
export interface CommentsMessage {
  type: "comments";
}

/** A comparison; `completed` of `total` passes are done. `seconds_left`: null if it is not running or nothing has been measured yet. `user`: who requested it; `created`, `started` and `ended` are times; null: not yet. `error_all_paths`: against all light paths, null if only the method's were requested; `error_method_paths`: against those of the method. `omitted_paths`: light paths of the look that the method does not simulate; `unsupported_paths`: light paths that the reference does not simulate either. Sentences; both empty before the first pass. */
export interface ComparisonBody {
  id: string;
  user: string;
  bake: string;
  view: string;
  state: "queued" | "running" | "ready" | "failed" | "canceled";
  created: string;
  started: string | null;
  ended: string | null;
  completed: number;
  total: number;
  progress: number;
  seconds_left: number | null;
  paths: "all" | "method";
  omitted_paths: string[];
  unsupported_paths: string[];
  error_all_paths: ComparisonFigures | null;
  error_method_paths: ComparisonFigures | null;
  problem: string | null;
}

/** Errors, each relative to the RMS of the reference over pixels and channels; see docs/accuracy.md. `rmse`: of the difference. `noise`: of the reference. `error`: of the frame, with the noise removed, and its `standard_error`: null if below the noise; `error_upper_bound` is its upper bound then. `significant_pixel_fraction`: fraction of pixels whose difference the noise does not explain, by chance at most 1 %. */
export interface ComparisonFigures {
  rmse: number;
  noise: number;
  error: number | null;
  standard_error: number | null;
  error_upper_bound: number;
  significant_pixel_fraction: number;
}

/** Response to a dry run: nothing was queued. `seconds`: duration once it starts. `is_measured`: false while no pass of this view has been timed and the estimate is from other views; ask again later. */
export interface ComparisonPlanBody {
  passes: number;
  seconds: number;
  is_measured: boolean;
}

/** An editable curve of a term; a `view_dependent` one multiplies the shaded pixel. */
export interface CurveBody {
  name: string;
  label: string;
  angle: string;
  parameters: string[];
  bands: number;
  view_dependent: boolean;
}

/** server → client: the active curve at this revision, band averages per channel, over 0…`max_degrees`. */
export interface CurveMessage {
  type: "curve";
  curve: string;
  revision: number;
  bands: number[][];
  generated: number[][];
  max_degrees: number;
}

/** A display and its views, in the config's order. */
export interface DisplayBody {
  name: string;
  views: string[];
}

/** server → client: the server is stopping. Open the session again, here or on another server, within so many seconds; until then this one continues. Send the look if the new server does not know the resume token. */
export interface DrainMessage {
  type: "server_draining";
  seconds: number;
}

/** Response to a dry run: nothing was queued. */
export interface DryRunBody {
  id: string;
  recipe: RecipeBody;
  plan: PlanBody;
}

/** An environment that looks can use instead of the scene's own, by `map`; `created` is null for built-in ones. `warnings`: changes made when its file was read. */
export interface EnvironmentBody {
  id: string;
  map: string;
  name: string;
  created: string | null;
  warnings: string[];
  thumbnail: string;
}

/** A built-in scene; `size` and `method` suit its bake. */
export interface ExampleSceneBody {
  name: string;
  label: string;
  description: string;
  size: [number, number];
  method: string;
}

/** Differences between a look and its file: by material, and of the scene, a sentence each. */
export interface ExportReportBody {
  materials: ExportedMaterial[];
  omitted: string[];
}

/** A material of an export. `look`: the variant; null for the exported look. `exact`: the file has the same reflectance. `error`: relative RMS error of cosine-weighted BRDF values. `omitted`: a sentence for each feature that the file does not have. */
export interface ExportedMaterial {
  name: string;
  look: string | null;
  exact: boolean;
  error: number;
  omitted: string[];
}

/** Exactness of an image with respect to its look, worst first; of several images, the worst counts. - PREVIEW: few samples of the target are shaded, and the others interpolated; or nothing is shown yet. - APPROXIMATE: an older look, the most important coefficients of the target, or a free-camera image. - INCREMENTAL: an exact image plus the approximate change of its light, or of a curve by merged lights or a subset of the samples. - NEAR_EXACT: a sum over the few nodes of a parameter, of quantized columns, or with noticeable float32 rounding; within a thousandth (relative RMS). - EXACT: the complete sum over all light that was baked. Everything below EXACT is replaced when nobody edits. The first exact image after a free camera stopped comes with the error of the image that was shown while it moved (`free_camera_error`). */
export type Fidelity = "preview" | "approximate" | "incremental" | "near_exact" | "exact";

/** Header of a binary frame. `room_revision`: of the last `RoomUpdate` that it shows. `camera_seq`: of the camera that it shows, null before the first one and for fixed cameras. `exact`: the client's whole image is exact; `fidelity`: of its visible region. `complete`: every term is shown. `free_camera_error`: with the first exact frame after the camera stopped: error of the image shown while it moved, without corrections. `traces_lobes`: a free camera traces rays along narrow lobes, which a browser cannot draw. `scene_update`: only for kind "scene_update". */
export interface FrameHeader {
  frame: number;
  revision: number;
  room_revision: number;
  view: string;
  width: number;
  height: number;
  tiles: [number, number, number, number][];
  format: "rgb9e5" | "jpeg" | "png" | "f32" | "r8" | "arrays";
  exact: boolean;
  fidelity: Fidelity;
  complete: boolean;
  kind: "picture" | "highlight" | "scene_update";
  alpha: boolean;
  camera_seq: number | null;
  free_camera_error: FreeCameraError | null;
  traces_lobes: boolean;
  scene_update: SceneUpdate | null;
  ms: FrameTimes;
}

/** Milliseconds spent on a frame: waiting, updating the image, encoding. */
export interface FrameTimes {
  wait: number;
  update: number;
  encode: number;
}

/** Sizes of the tables: `num_basis` K functions, rows over θo, columns over φo. `gradient_basis` for mapped normals, (3, K). `first_probes`: index of the first probe of each material, and the total. `arrays` are the names for GET /api/bakes/{id}/probes/{array}. `has_alpha_test`: some surfaces are alpha-tested, which the arrays do not contain; only images of the server show it. */
export interface FreeCameraBody {
  num_basis: number;
  table_rows: number;
  table_columns: number;
  recurrence: RecurrenceBody;
  gradient_basis: number[][];
  first_probes: number[];
  lobe_lists: LobeListsBody;
  shapes: LobeShapesBody;
  has_alpha_test: boolean;
  arrays: string[];
}

/** Error of free-camera images while the camera moves, over surfaces. `delta_e`: mean CIEDE2000 difference of the displayed images, about 1 is just noticeable; `rms`: relative RMS error of linear radiance. Standard errors: of estimates; null for one whole image. */
export interface FreeCameraError {
  delta_e: number;
  rms: number;
  delta_e_standard_error: number | null;
  rms_standard_error: number | null;
}

/** server → client: first message. `revision` and `solo` are the last ones of a resumed session, otherwise 0 and null. `visible_views`: views whose frames are sent, `focused_view` one of them; `views`: all baked views. `method`: of the bake; `axes`: what edits can change. `role`: with `view` no edits are accepted. `room`: the shared room, null if there is none. `free_camera_error`: measured in the bake, in the scene's default look; null without a free camera, and if it could not be measured. */
export interface HelloMessage {
  type: "hello";
  session: string;
  bake: string;
  method: string;
  axes: ("curve" | "parameter" | "light" | "environment" | "bounces" | "camera")[];
  scene: string;
  look: Record<string, unknown>;
  solo: string[] | null;
  revision: number;
  resumed: boolean;
  focused_view: string;
  visible_views: string[];
  views: ViewInfo[];
  materials: string[];
  resume: string;
  role: "view" | "edit" | "admin";
  room: RoomInfo | null;
  free_camera_error: FreeCameraError | null;
}

/** An IES file that point and spot lights of looks can use as `profile`. `candela`: its maximum intensity. `emission`: of a light with that intensity, W/sr. `warnings`: simplifications when it was read. `planes`: intensity over the maximum in the planes C0, C90, C180 and C270, every 5° from the nadir. */
export interface IesBody {
  id: string;
  profile: string;
  name: string;
  created: string;
  candela: number;
  emission: number;
  warnings: string[];
  planes: number[][];
}

/** An image that looks can use instead of a material's own: as `texture` or `roughness_map` of its terms, or as its `normal_map`. `size`: width and height. `warnings`: changes made when its file was read. `roughness`: mean of its green channel, the roughness of a material that uses it as a map. For images made from a metallic map: `metalness` is the id of that map; `base` is its base color: an image, "diffuse" or "scene" for the scene's own textures, or null if it is constant. */
export interface ImageBody {
  id: string;
  texture: string;
  name: string;
  created: string;
  size: [number, number];
  warnings: string[];
  roughness: number;
  metalness: string | null;
  base: string | null;
  thumbnail: string;
}

/** Properties of a scene that its file does not say. Attributes: up: the file's axis that points up. "file": as the file says, +Y if it does not. unit: the file's unit. "file": as the file says, meters if it does not. "auto": a guess from the size. recenter: whether positions are relative to the middle of the scene. "auto": if it is more than a hundred times its size from the origin, where single precision would round the shape. light_unit: unit of the file's punctual lights. "file": as the format says, candela and lux in glTF. "W/sr": radiometric, W/sr and W/m², as Blender exports "Unitless". "W": power of point and spot lights, as "Raw". scene_name: name or number of the scene to read, of a glTF file with several; empty for the file's default. time: moment of the animation, seconds in glTF, time code in USD. None: the rest pose of glTF, the first time of USD. */
export interface ImportOptions {
  up: "file" | "y" | "z" | "-z";
  unit: "file" | "m" | "cm" | "mm" | "in" | "ft" | "auto";
  recenter: "auto" | "always" | "never";
  light_unit: "file" | "W/sr" | "W";
  scene_name: string;
  time: number | null;
}

/** A file with materials. `warnings`: most severe first. */
export interface ImportedBody {
  id: string;
  name: string;
  created: string;
  materials: LibraryMaterialBody[];
  warnings: SceneWarning[];
}

/** server → client: one pixel; `bands` is the contribution of each band of the active curve, per channel. `position` and `normal`: of the surface that covers most of the pixel, world space; null for background. */
export interface InspectAnswer {
  type: "inspect";
  view: string;
  x: number;
  y: number;
  material: string | null;
  position: [number, number, number] | null;
  normal: [number, number, number] | null;
  radiance: [number, number, number];
  curve: string | null;
  bands: number[][] | null;
}

/** One material of an imported file. `terms`: complete, with uploaded images as textures. `normal_map`, `glass`: as in a look, null if it has none; `glass` applies to objects that are glass in the scene. */
export interface LibraryMaterialBody {
  name: string;
  terms: Record<string, unknown>[];
  normal_map: Record<string, unknown> | null;
  glass: Record<string, unknown> | null;
  thumbnail: string;
}

/** Light lists for lobes: `bins_per_side` of the map of direction bins, `max_listed` lights per bin, `lights_per_bright_light`; `min_width` is the smallest σ in radians of `widths` steps, each √2 times the one before. */
export interface LobeListsBody {
  bins_per_side: number;
  max_listed: number;
  lights_per_bright_light: number;
  min_width: number;
  widths: number;
}

/** Sizes of the highlight tables, see `relume.live.free_camera.basis.lobe_shapes`. Rings of half an octave, starting at the float with the bits `min_bits`; azimuths; light widths. */
export interface LobeShapesBody {
  elevation_rings: number;
  azimuths: number;
  widths: number;
  min_bits: number;
}

/** A saved look in a list. `created`: when it was first saved, the sort key of editors. `thumbnail`: URL of this version's image, relative to the server, null if there is none. `view`: saved with the look, null if none was. */
export interface LookEntry {
  name: string;
  etag: string;
  created: string;
  modified: string;
  bytes: number;
  thumbnail: string | null;
  view: LookView | null;
}

/** The view of a saved look: a view by name, and the pose of its free camera; null: as baked. */
export interface LookView {
  view: string;
  camera: CameraFrame | null;
}

/** Complete look and camera of each frame; cameras are null without a `path`. `crosses`: material of the first surface that the camera's path crosses, null if there is none. */
export interface LooksBody {
  looks: Record<string, unknown>[];
  cameras: CameraFrame[] | null;
  crosses: string | null;
}

/** A LUT of display values for looks, as their `display.lut`. `size`: nodes per channel of its table. `warnings`: changes made when its file was read. */
export interface LutBody {
  id: string;
  lut: string;
  name: string;
  created: string;
  size: number;
  warnings: string[];
}

/** A material in the plane of reflectance at normal incidence and roughness; `id` is that of its library entry. */
export interface MapPoint {
  id: string;
  f0: number;
  sigma: number;
}

/** A library material under one model, as terms for a look and as a list entry. `id` is "table/material", `group` its category, `model` that of its highlight, `swatch` its color "#rrggbb". */
export interface MaterialBody {
  id: string;
  name: string;
  group: string;
  model: string;
  source: string;
  swatch: string;
  terms: Record<string, unknown>[];
}

/** Sun's navigation map; `triangles` are indices of points, counter-clockwise with x = f0 and y = log sigma. */
export interface MaterialMapBody {
  points: MapPoint[];
  triangles: [number, number, number][];
}

/** The caller. `login`: whether this server has a login; `auth_method`: how the caller was identified (`open`: no login). `allow_viewer_comments`: whether the role view may write comments. */
export interface MeBody {
  login: boolean;
  name: string;
  role: "anyone" | "view" | "edit" | "admin";
  auth_method: "open" | "nobody" | "token" | "proxy";
  allow_viewer_comments: boolean;
}

/** A measured material; looks refer to it by `data`, `terms` are its initial terms. `lobes_error` (measured_lv + measured_hd) and `homomorphic_error` (measured_hf): of the curves alone, per channel. `warnings`: what the conversion from another layout than MERL changed. */
export interface MeasuredBody {
  id: string;
  data: string;
  name: string;
  created: string;
  terms: Record<string, unknown>[];
  thumbnail: string;
  lobes_error: [number, number, number];
  homomorphic_error: [number, number, number];
  warnings: string[];
}

/** Terms that use the metallic map: textures of diffuse terms and highlights, and their mean f0. */
export interface MetalnessBody {
  terms: Record<string, unknown>[];
}

/** The complete look with the light mix, and a sentence for each thing that it does not have. */
export interface MixedLookBody {
  look: Record<string, unknown>;
  warnings: string[];
}

/** A BRDF model; `texture` is its default texture channel, `needs_data` whether it is measured, `width_parameter` the parameter that roughness maps scale, `width_power` the power of roughness that it grows with, `specular_below` the value below which it is a mirror, and `data_prefix` the prefix of its data names (see `data`). */
export interface ModelBody {
  model: string;
  label: string;
  help: string;
  source: string;
  texture: string;
  needs_data: boolean;
  width_parameter: string | null;
  width_power: number | null;
  specular_below: number | null;
  data_prefix: string | null;
  parameters: ParameterBody[];
  curves: CurveBody[];
}

/** A numeric parameter that generates curves; `scale` is the scale of its slider. If `requires_new_operator`, it has one value for all channels, and a change precomputes the operator anew. Values are multiples of `step`, if given. */
export interface ParameterBody {
  name: string;
  label: string;
  minimum: number;
  maximum: number;
  default: number;
  unit: string;
  scale: "linear" | "log";
  help: string;
  step: number | null;
  requires_new_operator: boolean;
}

/** server → client: `length` of a path to its first surface, meters, with its material and unit normal; null if the path is free. `solid`: material of the closed surface that its last point is in, as inside a wall; null in rooms and in the open. */
export interface PathAnswer {
  type: "path";
  id: number;
  length: number | null;
  material: string | null;
  normal: [number, number, number] | null;
  solid: string | null;
}

/** The first surface on a path: path `length` to it, meters, its material and unit normal; null without one. */
export interface PathBody {
  length: number | null;
  material: string | null;
  normal: [number, number, number] | null;
}

/** A participant. `id`: constant while in the room. `online`: false while the connection is lost. */
export interface Person {
  id: number;
  name: string;
  color: string;
  material: string | null;
  role: "view" | "edit" | "admin";
  online: boolean;
}

/** Point and normal in world space, meters; null if nothing is there. */
export interface PickBody {
  position: number[] | null;
}

/** Cost of a bake. Upper bounds, except `store_bytes`, which is estimated from a sample and rounded up, and `seconds`, which is estimated from finished bakes and null if there are none. */
export interface PlanBody {
  view_samples: number;
  rays: number;
  store_bytes: number;
  peak_bytes: number;
  seconds: number | null;
}

/** server → client: answer to a `PingMessage`. */
export interface PongMessage {
  type: "pong";
}

/** Principled `parameters` of a material. If they have its terms, `reason` is null; otherwise `parameters`, `terms` and `glass` are those of the closest principled material, `error` is its relative RMS error of cosine-weighted BRDF values, and `reason` a sentence. */
export interface PrincipledBody {
  terms: Record<string, unknown>[];
  glass: Record<string, unknown> | null;
  parameters: PrincipledParameters;
  error: number;
  reason: string | null;
  texture_means: TextureMeansBody;
}

/** Principled parameters, as in docs/api.md: colors are linear Rec. 709, roughness is perceptual. */
export interface PrincipledParameters {
  base_color: [number, number, number];
  metallic: number;
  roughness: number;
  specular: number;
  specular_color: [number, number, number];
  ior: number;
  anisotropy: number;
  coat_weight: number;
  coat_roughness: number;
  sheen_weight: number;
  sheen_color: [number, number, number];
  sheen_roughness: number;
  transmission: number;
}

/** RFC 9457 problem. `type` is the kind, `detail` says what happened and what to do. */
export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  [extra: string]: unknown;
}

/** server → client: a message was rejected; the look is unchanged. */
export interface ProblemMessage {
  type: "problem";
  revision: number | null;
  problem: Problem;
}

/** The complete recipe; `cameras` are those of placed or custom `views`. `probes`: null for fixed cameras. `patches`, `gather_rays`: null if the method chooses. */
export interface RecipeBody {
  method: string;
  views: string[];
  size: [number, number];
  lights: number;
  probes: number | null;
  patches: number | null;
  gather_rays: number | null;
  relightable: boolean;
  cameras: CameraBody[];
}

/** Recurrence table of the Zernike basis; see `relume.math.zernike.Recurrence`. */
export interface RecurrenceBody {
  order: number[];
  norm: number[];
  cosine: number[];
  sine: number[];
  a: number[];
  b: number[];
  c: number[];
}

/** A batch; `completed` of `total` frames are finished, `progress` 0…1 includes part of the current one. `baking`: progress 0…1 of a bake that it waits for; null: none. `seconds_left`: null if it is not running or nothing has been measured yet. `user`: who requested it; "" without login. `view`: null if there are several `views`. `warnings`: a sentence for each part of a light mix that a scene does not have. `created`, `started` and `ended` are times; null: not yet. */
export interface RenderBody {
  id: string;
  name: string | null;
  user: string;
  bake: string;
  view: string | null;
  views: BakeView[];
  format: "exr" | "png" | "webp" | "mp4" | "contact_sheet";
  size: [number, number] | null;
  priority: number;
  warnings: string[];
  state: "queued" | "running" | "ready" | "failed" | "canceled";
  created: string;
  started: string | null;
  ended: string | null;
  completed: number;
  total: number;
  progress: number;
  seconds_left: number | null;
  problem: string | null;
  baking: number | null;
}

/** Response to a dry run: nothing was queued. `file_names`: of the first images, of `total`. `bytes`: upper bound of all files. `bakes`: bakes that the render starts and waits for, with their costs. */
export interface RenderPlanBody {
  file_names: string[];
  total: number;
  bytes: number;
  warnings: string[];
  bakes: DryRunBody[];
}

/** The room of a session. `id` opens it for editing, null for view-only participants; `view_token` opens it view-only. `participant_token` rejoins as the same participant, `self_id` is its id. `is_new`: the room was empty, so it has the look of this session. `default_look`: the scene's default look. */
export interface RoomInfo {
  id: string | null;
  view_token: string;
  participant_token: string;
  self_id: number;
  is_new: boolean;
  people: Person[];
  default_look: Record<string, unknown>;
}

/** server → client: current participants; `self_id` is oneself. */
export interface RoomMessage {
  type: "room";
  self_id: number;
  people: Person[];
}

/** server → client: changes of the room's look since the last such message, or `hello`, including this session's own edits up to `revision`. The `patch` is empty if there were no others. `room_revision` counts the changes, and frames repeat it. `edited_by`: ids of the participants who edited. */
export interface RoomUpdate {
  type: "room_update";
  revision: number;
  room_revision: number;
  patch: SharedOperation[];
  edited_by: number[];
}

/** A scene; `materials` in the order of the ids in `/views/{view}/materials.png`, `bakes` newest first. `warnings`: most severe first. `import_options`: for the next import of its file. `size`: sides of its bounding box along x, y and z without a shadow catcher, meters; null for a scene of an older version. `objects`: names for the links of lights; empty for a scene of an older version, or with more than 2,000. */
export interface SceneBody {
  id: string;
  name: string;
  created: string;
  views: SceneView[];
  materials: SceneMaterial[];
  lights: string[];
  objects: string[];
  variants: SceneVariant[];
  warnings: SceneWarning[];
  import_options: ImportOptions;
  size: [number, number, number] | null;
  triangles: number;
  thumbnail: string | null;
  bakes: string[];
}

/** A material and its default terms, as in look documents. `catcher`: it is the ground, which looks may show as a shadow catcher. `is_projected`: most of its triangles have no texture coordinates and use a projection. `is_glass`: it transmits light, as defined by the scene's file; looks edit its glass, but cannot make other materials transmit. `is_textured`: it has an image of the scene's file. `objects`: names of its objects; empty as those of the scene. */
export interface SceneMaterial {
  name: string;
  terms: Record<string, unknown>[];
  shadow_catcher: boolean;
  is_projected: boolean;
  is_glass: boolean;
  is_textured: boolean;
  objects: string[];
}

/** Shader constants of a look, besides arrays. `gain`: of the image; `environment_gain`, `background_gain`: of the prefiltered environment for lobes, and of the background, per channel. `environment_rotation`: added to u. `environment_mips`: first texel, height and width of each. `bright_lights`: bright environment lights, which lobes evaluate separately: direction, radiance, spread. `shows_direct`: direct light and the background are visible. `arrays`: those in the payload; all others are unchanged. */
export interface SceneUpdate {
  gain: [number, number, number];
  environment_gain: [number, number, number];
  background_gain: [number, number, number];
  environment_rotation: number;
  environment_mips: [number, number, number][];
  bright_lights: [number, number, number, number, number, number, number][];
  background: "map" | "blurred" | "color" | "transparent";
  background_color: [number, number, number];
  background_size: [number, number];
  shows_direct: boolean;
  arrays: ArrayInfo[];
}

/** A material variant of the scene's file, as a partial look document. */
export interface SceneVariant {
  name: string;
  look: Record<string, unknown>;
}

/** A camera; `aspect` is width ÷ height. `is_placed`: placed by a user, not from the scene's file. */
export interface SceneView {
  name: string;
  aspect: number;
  is_placed: boolean;
}

/** An import warning. `severity`: the feature is missing or wrong in the image ("unsupported"), looks much the same ("approximated"), or does not change the image ("ignored"). `where`: the part of the file, empty for all of it. */
export interface SceneWarning {
  text: string;
  severity: "unsupported" | "approximated" | "ignored";
  where: string;
}

/** Content of a share link; `missing`: one sentence for each deleted part of it. */
export interface ShareBody {
  bake: string;
  view: string;
  views: string[];
  look: Record<string, unknown>;
  solo: string | null;
  solo_light: string | null;
  paths: SharedPaths | null;
  cameras: Record<string, CameraFrame>;
  sizes: Record<string, [number, number]>;
  id: string;
  created: string;
  scene: string;
  missing: string[];
}

/** A new share link; `url` is relative to the server. */
export interface ShareEntry {
  id: string;
  url: string;
}

/** One operation of a change of the shared look. A path may already exist for `add`, or be missing for `remove`. */
export interface SharedOperation {
  op: "replace" | "add" | "remove";
  path: string;
  value: unknown;
}

/** A part of the target that cannot be reached. `stroke`: its index, null for a whole reference picture. `cause`: all lights that reach it are `locked`; `no_light` reaches it; or lights that do, reach other pixels, too (`conflict`). `asked_stops`, `reached_stops`: change of its mean luminance, null from or to black. */
export interface ShortfallBody {
  stroke: number | null;
  residual: number;
  cause: "locked" | "no_light" | "conflict";
  asked_stops: number | null;
  reached_stops: number | null;
}

/** The solution. `patch`: JSON Patch on the complete look; `look`: the look of the request with these changes. `changes`: changed lights; `materials`: names of changed materials, whose terms the patch replaces. `residual`, `residual_before`: relative RMS error of the marked pixels; 0 if none are marked. */
export interface SolveBody {
  patch: PatchOperation[];
  look: Record<string, unknown>;
  residual: number;
  residual_before: number;
  changes: SourceChange[];
  materials: string[];
  shortfalls: ShortfallBody[];
}

/** Change of a light. `pointer`: JSON pointer of the light in the look. `stops`: of its luminance; null from or to black. */
export interface SourceChange {
  pointer: string;
  stops: number | null;
}

/** server → client: something takes time; `progress` 0…1. A curve is precomputed for edits (`label` names it), or a term is shaded for the first time; "ready" ends it. Other work continues meanwhile. */
export interface StatusMessage {
  type: "status";
  state: "precomputing" | "shading" | "ready";
  view: string;
  label: string;
  progress: number;
}

/** A view of a display, as in a look's `display.tone_map`. */
export interface ViewBody {
  display: string;
  view: string;
}

/** A view, its size in pixels and its camera; `camera_mode`: fixed at the baked camera, or free. For a free camera `bounds` are the minimum and maximum corner of the scene, meters, and `interior_camera` is in its largest room. */
export interface ViewInfo {
  name: string;
  width: number;
  height: number;
  camera: CameraInfo;
  camera_mode: "fixed" | "free";
  bounds: [number[], number[]] | null;
  interior_camera: CameraInfo | null;
}

/** Bounds of a scene, meters; a camera that sees all of it; one in its largest room, null if nothing is enclosed. `opens_inside`: the scene is a closed room that its first camera sees only from outside. */
export interface ViewportBody {
  bounds_min: number[];
  bounds_max: number[];
  default_camera: CameraFrame;
  interior_camera: CameraFrame | null;
  opens_inside: boolean;
}

/** Picture of a term while a free camera moves: `functions` of `available` basis functions, with a `residual` (cosine-weighted relative RMS); `required_functions`: number with a residual of at most 5 %, null if more than available; `drawn_by`: functions alone; lights: the environment's highlight is summed over visible lights, other light uses functions; rays: reflections are ray traced by the server, and blurred environment in a browser. */
export interface ZernikeFitBody {
  functions: number;
  available: number;
  residual: number;
  required_functions: number | null;
  drawn_by: "functions" | "lights" | "rays";
}

export type ClientMessage =
  | OpenMessage
  | EditMessage
  | ViewMessage
  | ViewsMessage
  | FocusMessage
  | RegionMessage
  | AckMessage
  | EncodingMessage
  | InspectMessage
  | PathMessage
  | HighlightMessage
  | PrepareMessage
  | CameraMessage
  | RendererMessage
  | PresenceMessage
  | PingMessage;

export type ServerMessage =
  | HelloMessage
  | StatusMessage
  | ProblemMessage
  | InspectAnswer
  | PathAnswer
  | CurveMessage
  | BakeMessage
  | DrainMessage
  | RoomMessage
  | RoomUpdate
  | CommentsMessage
  | PongMessage;
