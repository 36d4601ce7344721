// Written by `python -m relume_server.typescript` from the server's models. Do not edit.


export const SUBPROTOCOL = "relume.v2";

export const MAX_MESSAGE_BYTES = 65536;

export const MAX_FRAMES_IN_FLIGHT = 2;

export const MAX_VISIBLE_VIEWS = 4;

export const MAX_CAMERA_PIXELS = 2304000;

export const PROBES_LAYOUT = 3;

export const MAX_PERSON_NAME = 40;

export const ROOM_PREFIX = 8;

export const MAX_COMMENT = 2000;

export const LUT_SIZE = 65;

export const LUT_GAIN = 9;

/** client → server: this frame was received and shown. */
export interface AckMessage {
  type: "ack";
  frame: number;
}

/** What to bake. A preset gives size and lights; what is named beside it wins. `aspect`: width ÷ height of the preset's picture, of as many pixels; beside a `size` it says nothing. `views`: names of the scene's cameras, or cameras, which become part of the recipe; all that came with the scene where none are named. `probes`: surface probes of a free camera (method `probes`); refused for fixed views, which have none. `patches`: surface patches that indirect light is stored for; `gather_rays`: of a view sample or probe; by default as many as fit the picture (methods `gather` and `probes`). `relightable`: divide the light so that turning or exchanging the environment errs little. */
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

/** A camera that a person placed, by name. */
export interface CameraBody {
  to_world: number[];
  yfov: number;
  name: string;
}

/** Where a camera is and how wide it looks. `to_world`: camera to world, 16 numbers by row, looking along -Z; scale is taken out. `yfov`: vertical, degrees. */
export interface CameraFrame {
  to_world: number[];
  yfov: number;
}

/** client → server: see a view whose camera is "free" from here, in a picture of this size; the latest wins, and frames name its `seq` as `camera_seq`. `to_world`, by row, and `yfov`: as in `CameraInfo`. `active_control`: as in an edit; nothing is prepared for it. `refine`: "exact", an exact picture from there follows when the camera stops, and edits go on in it; "none", none does. */
export interface CameraMessage {
  type: "camera";
  view: string;
  seq: number;
  to_world: number[];
  yfov: number;
  size: [number, number];
  active_control?: string | null;
  refine?: "exact" | "none";
}

/** From camera to camera, at even shares of the frames; one frame each where no number of frames is given. */
export interface CameraPath {
  cameras: CameraFrame[];
}

/** Whether a comment is settled. */
export interface CommentChange {
  resolved: boolean;
}

/** Pin words to a pixel. `x`, `y`: of the picture of `view` as it was `size` large, from its upper left corner. `camera`: where a view was seen from whose eye moves. `text`: plain. `author`: taken where nobody logs in. `picture`: of the moment, a PNG, JPEG or WebP in Base64, at most 1024 pixels a side. */
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

/** Compare a look with brute force, in so many passes; figures come from the second on. `paths`: "all" that the scene has, and those that the bake's method follows beside them; or "method", these alone, which is sooner done. Where the eye moves: `camera`, from where it is seen, and `size` of the picture; by default as it was baked. */
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

/** client → server: change the look; `revision` must be newer than the last. `active_control` is what is being dragged: a curve, or what `PrepareMessage` may name as `parameter`, in the look after the edit; null for all other edits. `solo` names sources of light, local lights and "environment", that alone are shown from now on, without being part of the look; null: all. Left out, it stays as it was. An edit that says `solo` may have an empty patch. */
export interface EditMessage {
  type: "edit";
  revision: number;
  patch: PatchOperation[];
  active_control?: string | null;
  solo?: string[] | null;
}

/** client → server: how pictures are sent. "auto": HDR, JPEG while moving where the link is too slow for it. */
export interface EncodingMessage {
  type: "encoding";
  format: "hdr" | "jpeg" | "auto";
  quality?: number;
}

/** client → server: the pointer is in this view, one of those that are shown: its frames and freezes go first. */
export interface FocusMessage {
  type: "focus";
  view: string;
}

/** client → server: which pixels does this stretch of a curve light? Each shown view answers by a frame "highlight". */
export interface HighlightMessage {
  type: "highlight_curve_range";
  curve: string;
  from: number;
  to: number;
}

/** client → server: what makes up this pixel? Of a shown view, the focused one by itself; see `InspectAnswer`. */
export interface InspectMessage {
  type: "inspect";
  view?: string | null;
  x: number;
  y: number;
}

/** What each frame of an animation shows; `view`: of which `path` is a way. */
export interface LooksRequest {
  bake: string;
  looks: Record<string, unknown>[];
  frames?: number | null;
  interpolation?: "parameters" | "map";
  path?: Turntable | CameraPath | null;
  view?: string | null;
}

/** client → server: first message, and sent once. All of it may be left out; null is the same. `room`, or to watch only `view_token`, names the room in which others share the look; the address then has the first eight characters of it as `room_prefix`. `participant_token`: this client's in that room. `name`: how to be called, where nobody logs in. `share`, or `look`: the shared or saved look to begin with. `resume`: token of a session that was lost. */
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

/** client → server: is anybody there? Answered by a `PongMessage` at once, whatever is being computed. */
export interface PingMessage {
  type: "ping";
}

/** client → server: one of two: the user opened this `curve`: freeze it ahead and send its `CurveMessage` from now on; or has in hand what moves this `parameter`, which may also be a light (/lights/NAME) or a field of the environment: prepare for it, the open curve stays open. */
export interface PrepareMessage {
  type: "prepare";
  curve?: string | null;
  parameter?: string | null;
}

/** client → server: what others in the room see of this one: the name, where nobody logs in (left out: as it was), and the selected material. */
export interface PresenceMessage {
  type: "presence";
  name?: string | null;
  material?: string | null;
}

/** client → server: of a view whose camera is "fixed" this region is on the screen: x, y, width, height in pixels of its picture. It is exact before all else, frames of what is on its way bring its tiles alone, and `fidelity` is that of what is in it. null: all of the picture, as it is before anything is said. */
export interface RegionMessage {
  type: "region";
  view: string;
  rect: [number, number, number, number] | null;
}

/** A batch of exact pictures; looks may be partial. `size`: at most the baked one, which is the default; where the eye moves, any. `name`: what downloads are called; by default the scene and the view. Of EXR alone: `layers` beside the picture, one for each light and each kind of light path, or "light_groups", direct and reflected light of each light, together the picture; `precision` of the values; and `color_space`, a linear one of the server's OpenColorIO config (GET /api/color), else linear Rec. 709. Of an animation: `path` and `frames`, see POST /api/renders/looks. `format` "mp4" makes a video of them, `fps` frames a second. `quality`: "interactive" renders frames of a free camera as they look while it moves, a hundred times sooner. */
export interface RenderRequest {
  bake: string;
  looks: Record<string, unknown>[];
  frames?: number | null;
  interpolation?: "parameters" | "map";
  path?: Turntable | CameraPath | null;
  view: string;
  format: "exr" | "png" | "webp" | "mp4";
  size?: [number, number] | null;
  name?: string | null;
  layers?: boolean | "light_groups";
  precision?: "half" | "float";
  color_space?: string | null;
  fps?: number;
  quality?: "exact" | "interactive";
}

/** client → server: who renders views whose camera is "free" while they move. "client": from now on frames of kind "scene_update" bring what a shader needs, beside what GET /api/bakes/{id}/probes gave once, each part again where it has changed; no frame comes for a camera alone. Exact pictures come as ever. */
export interface RendererMessage {
  type: "renderer";
  renderer: "client" | "server";
}

/** What a link shows: a look of a bake, the views beside each other and the one in hand. `solo`, `solo_light`: a material, a source of light ("" is the environment) that is shown alone. `paths`: the light paths that are looked at; null: those of the look. `cameras`: of views whose camera is free, by name; `sizes`: of their pictures, pixels, where they are not as large as was baked. */
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

/** Light paths that are looked at; as a look's `transport`. */
export interface SharedPaths {
  show: "all" | "direct" | "indirect" | "first_bounce" | "further_bounces";
  bounces: number;
}

/** A BTF to be rendered from a small geometry, `size` texels wide; nothing of it is measured. */
export interface SyntheticBtfRequest {
  geometry: "weave" | "pebbles" | "corduroy";
  size?: number;
  error?: number;
  name?: string | null;
}

/** Terms as they stand in a look. */
export interface TermsRequest {
  terms: Record<string, unknown>[];
}

/** Once around an upright line, in so many frames; `start_camera`: the first of them, by default where the view begins. `pivot`: a place on the line, metres; by default in the middle of the first picture, as deep as what it shows. `rotate`: the `camera`; or, before a camera that stays, the `object`, under an environment and lights that stay, too; or the `environment` alone, which needs no bake with a free camera. */
export interface Turntable {
  turntable: number;
  start_camera?: CameraFrame | null;
  pivot?: number[] | null;
  rotate?: "camera" | "object" | "environment";
}

/** client → server: show this view alone. `size` is the space that the client has, in pixels: JPEGs are scaled down to fit into it, until views are shown otherwise; all other frames come in the baked size. */
export interface ViewMessage {
  type: "view";
  name: string;
  size?: [number, number] | null;
}

/** client → server: show these views side by side; every edit changes all of them. */
export interface ViewsMessage {
  type: "views";
  names: string[];
}

/** What share of even light a material sends back, its textures white: the `mean` over all directions, and the `max` in any channel, at `max_angle_degrees` from the normal. */
export interface AlbedoBody {
  mean: number[];
  max: number;
  max_angle_degrees: number;
}

/** An array of a payload or of GET /api/bakes/{id}/probes: so many texels of 1, 2 or 4 numbers. */
export interface ArrayInfo {
  name: string;
  dtype: "float32" | "float16" | "uint32" | "int32";
  shape: [number, number];
}

/** A bake; `progress` 0…1, `problem` one sentence where it failed, or had to start again. `phase`: what it does while it runs, and for how many seconds already. `queue_position`: bakes that a queued one waits for. `is_current`: whether the code that made it, which `code` names, is the server's own; others can be used, but might come out otherwise if it were baked again. `user` asked for it first, `created` says when. */
export interface BakeBody {
  id: string;
  user: string;
  created: string;
  scene: string;
  state: "queued" | "running" | "ready" | "failed" | "cancelled";
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

/** server → client: another bake of the same scene goes on or is ready; open a session on it and send the look. */
export interface BakeMessage {
  type: "bake";
  bake: string;
  replaces: string;
  state: string;
  progress: number;
  phase: "starting" | "loading" | "reading" | "building" | "compiling" | "sampling" | "tracing" | "publishing" | null;
  seconds_left: number | null;
}

/** A bidirectional texture; looks name it by `data`, `terms` is how it begins. `synthetic` says which geometry it was rendered from; null where it was measured. `error` is the relative RMS of the compression by how many components are used, from none on; `ratio` what is saved by it. */
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
}

/** A BTF in the making. `material`: its id where it is ready. `geometry`: null where images were sent. `user` asked for it; `created`, `started` and `ended` are times; null: not yet. */
export interface BtfJobBody {
  id: string;
  name: string;
  user: string;
  geometry: "weave" | "pebbles" | "corduroy" | "mesh" | null;
  state: "queued" | "running" | "ready" | "failed" | "stopped";
  created: string;
  started: string | null;
  ended: string | null;
  progress: number;
  seconds_left: number | null;
  material: string | null;
  problem: string | null;
}

/** A camera of a scene; `is_placed`: somebody placed it, it did not come with the scene. */
export interface CameraEntry {
  to_world: number[];
  yfov: number;
  name: string;
  is_placed: boolean;
}

/** Looks along its -Z. `to_world`: camera to world, 4 × 4 by row, rigid, metres. `yfov`: vertical, radians. */
export interface CameraInfo {
  to_world: number[];
  yfov: number;
}

/** Without a config all of it is null or empty. `id` changes with the config; `default`: the view that the config shows unasked; `working`: its name of linear Rec. 709; `spaces`: its linear colour spaces, in which EXR files may be rendered. */
export interface ColorBody {
  id: string | null;
  name: string | null;
  working: string | null;
  displays: DisplayBody[];
  default: ViewBody | null;
  spaces: string[];
}

/** A comment. `picture`: address of the picture of the moment, relative to the server, null where there is none. */
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

/** server → client: somebody has written, settled or deleted a comment on the scene; read the list again. */
export interface CommentsMessage {
  type: "comments";
}

/** A comparison; `completed` of `total` passes are done. `seconds_left`: null where it does not run or nothing was measured yet. `user` asked for it; `created`, `started` and `ended` are times; null: not yet. `error_all_paths`: against all light paths, null where only the method's were asked for; `error_method_paths`: against those that the method follows. `omitted_paths`: which paths the method leaves out of what the look shows; `unsupported_paths`: which brute force leaves out, too. In sentences; both are empty before the first pass. */
export interface ComparisonBody {
  id: string;
  user: string;
  bake: string;
  view: string;
  state: "queued" | "running" | "ready" | "failed" | "stopped";
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

/** Each relative to the truth's root mean square over pixels and channels; see docs/accuracy.md. `rmse` of the difference, `noise` of the brute force, `error` of the frame with the noise taken off, and its `standard_error`: null where that cannot be told from the noise, `error_upper_bound` is what it is below then. `significant_pixel_fraction`: share of pixels whose difference the noise does not explain, at most a hundredth of them by chance. */
export interface ComparisonFigures {
  rmse: number;
  noise: number;
  error: number | null;
  standard_error: number | null;
  error_upper_bound: number;
  significant_pixel_fraction: number;
}

/** The answer to a dry run: nothing was queued. `seconds` that it will take, once it has its turn. `is_measured`: false where nothing of this view was timed yet, and pictures of others tell; ask again in a moment. */
export interface ComparisonPlanBody {
  passes: number;
  seconds: number;
  is_measured: boolean;
}

/** An editable factor of a term; a `view_dependent` one multiplies the finished pixel. */
export interface CurveBody {
  name: string;
  label: string;
  angle: string;
  parameters: string[];
  bands: number;
  view_dependent: boolean;
}

/** server → client: the touched curve at this revision, band averages per channel, over 0…`max_degrees`. */
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

/** server → client: the server is being stopped. Open the session again, there or on another server, within so many seconds; until then it goes on. The look is the client's to bring, where the new server does not know the token. */
export interface DrainMessage {
  type: "server_draining";
  seconds: number;
}

/** The answer to a dry run: nothing was queued. */
export interface DryRunBody {
  id: string;
  recipe: RecipeBody;
  plan: PlanBody;
}

/** An environment that looks may name, by `map`, in place of the scene's own; `created` is null for a built-in one. `warnings`: what was changed when its file was read. */
export interface EnvironmentBody {
  id: string;
  map: string;
  name: string;
  created: string | null;
  warnings: string[];
  thumbnail: string;
}

/** A scene made by code; `size` and `method` of a bake show it well. */
export interface ExampleSceneBody {
  name: string;
  label: string;
  description: string;
  size: [number, number];
  method: string;
}

/** Header of a binary frame. `room_revision`: of the last `RoomUpdate` whose look it shows. `camera_seq`: of the camera that it shows, null before the first and of fixed views. `exact`: all that the client has of the picture is; `fidelity`: of what is in its region. `complete`: something of every term is shown. `previous_error`: of the first exact frame after the camera stopped, how far the approximate picture was from it, relative RMS. `scene_update`: of kind "scene_update" alone. */
export interface FrameHeader {
  frame: number;
  revision: number;
  room_revision: number;
  view: string;
  width: number;
  height: number;
  tiles: [number, number, number, number][];
  format: "rgb9e5" | "jpeg" | "f32" | "r8" | "arrays";
  exact: boolean;
  fidelity: "preview" | "approximate" | "incremental" | "near_exact" | "exact";
  complete: boolean;
  kind: "picture" | "highlight" | "scene_update";
  alpha: boolean;
  camera_seq: number | null;
  previous_error: number | null;
  scene_update: SceneUpdate | null;
  ms: FrameTimes;
}

/** Milliseconds spent on a frame: edit waiting, updating the picture, encoding. */
export interface FrameTimes {
  wait: number;
  update: number;
  encode: number;
}

/** Sizes of the tables: `num_basis` K functions, rows over θo, columns over φo. `gradient_basis` for mapped normals, (3, K). `first_probes`: where those of each material begin, and one more at the end. `arrays` are the names of what GET /api/bakes/{id}/probes/{array} gives. `has_alpha_test`: some surfaces are not everywhere, which the arrays do not say: pictures of the server show it. */
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

/** How far pictures are from the exact ones while an eye moves, measured in the bake: relative RMS over the surfaces that a few eyes see, in the scene's own look. */
export interface FreeCameraError {
  value: number;
  standard_error: number;
}

/** server → client: first message. `revision` and `solo` are the last ones of a resumed session, else 0 and null. `visible_views` are the views that frames come of, `focused_view` is one of them; `views` are all that were baked. `method`: the light of the bake; `axes`: what can be changed in its pictures. `role`: who may only `view` sends no edits. `room`: where others share the look, null for a session of one. `free_camera_error`: null where no camera is free, and where it could not be measured. */
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

/** An image that looks may name in the place of a material's own: `texture` or `roughness_map` of its terms, its `normal_map`. `size`: width and height. `warnings`: what was changed when its file was read. `roughness`: the mean of its green, how rough a material is that has it as its map. `metalness`: of one that was made and not sent, the image that says where it is metal; `base`: its base colour, an image, "diffuse" or "scene" of the scene's own textures, or null where that is the same everywhere. */
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

/** server → client: one pixel; `bands` is each band's contribution of the active curve, per channel. `position` and `normal` are of the surface that covers most of it, world space; null for background. */
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

/** Lists of lights that lobes look for: `bins_per_side` of the map of directions, `max_listed` for each bin, `lights_per_bright_light`; `min_width` is the least σ, radians, of so many `widths`, each √2 times the one before. */
export interface LobeListsBody {
  bins_per_side: number;
  max_listed: number;
  lights_per_bright_light: number;
  min_width: number;
  widths: number;
}

/** Sizes of tables of highlights, see `relume.live.free_camera.basis.lobe_shapes`. Rings, half an octave each, from the float that has the bits `min_bits`; azimuths; widths of lights. */
export interface LobeShapesBody {
  elevation_rings: number;
  azimuths: number;
  widths: number;
  min_bits: number;
}

/** A saved look in the list of them. `created`: when it was saved first, which editors sort by. `thumbnail`: address of the picture of this version, relative to the server, null where there is none. */
export interface LookEntry {
  name: string;
  etag: string;
  created: string;
  modified: string;
  bytes: number;
  thumbnail: string | null;
}

/** The complete look of each frame, and from where it is seen; null where no `path` was given. */
export interface LooksBody {
  looks: Record<string, unknown>[];
  cameras: CameraFrame[] | null;
}

/** A material in the plane of reflectance seen head-on and roughness; `id` is that of its library entry. */
export interface MapPoint {
  id: string;
  f0: number;
  sigma: number;
}

/** A library material under one model: what stands in a look, and how a list shows it. `id` is "table/material", `group` what it is made of, `model` that of its highlight, `swatch` its colour "#rrggbb". */
export interface MaterialBody {
  id: string;
  name: string;
  group: string;
  model: string;
  source: string;
  swatch: string;
  terms: Record<string, unknown>[];
}

/** Sun's navigation map; `triangles` are indices of points, counter-clockwise where x is f0 and y is log sigma. */
export interface MaterialMapBody {
  points: MapPoint[];
  triangles: [number, number, number][];
}

/** Who calls. `login`: whether people log in here; `auth_method`: how this one is known (`open`: nobody is asked). `allow_viewer_comments`: whether those who only look may write comments. */
export interface MeBody {
  login: boolean;
  name: string;
  role: "anyone" | "view" | "edit" | "admin";
  auth_method: "open" | "nobody" | "token" | "proxy";
  allow_viewer_comments: boolean;
}

/** A measured material; looks name it by `data`, `terms` is how it begins. `lobes_error` (measured_lv + measured_hd) and `homomorphic_error` (measured_hf): of the curves alone, per channel. */
export interface MeasuredBody {
  id: string;
  data: string;
  name: string;
  created: string;
  terms: Record<string, unknown>[];
  thumbnail: string;
  lobes_error: [number, number, number];
  homomorphic_error: [number, number, number];
}

/** What its terms become: textures of what scatters light and of highlights, and their mean f0. */
export interface MetalnessBody {
  terms: Record<string, unknown>[];
}

/** A BRDF term; `texture` is the channel it takes by default, `needs_data` whether it is measured, `width_parameter` the one that maps of roughness scale, `width_power` the power of a roughness that it grows with, `specular_below` where it makes a mirror, and `data_prefix` how the names of such data begin (see `data`). */
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

/** A number that generates curves; `scale` says how a slider moves. One that `requires_new_operator` has one value for all channels; a change of it precomputes the operator anew. Values are multiples of `step`, where it is given. */
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

/** Somebody in a room. `id`: theirs as long as they are in it. `online`: false while their connection is lost. */
export interface Person {
  id: number;
  name: string;
  color: string;
  material: string | null;
  role: "view" | "edit" | "admin";
  online: boolean;
}

/** World space, metres; null where nothing is there. */
export interface PickBody {
  position: number[] | null;
}

/** What a bake will cost; upper bounds, but for `store_bytes`, on disk, as a little of it takes, rounded up; and `seconds`: judged by finished bakes, null where there are none. */
export interface PlanBody {
  view_samples: number;
  rays: number;
  store_bytes: number;
  peak_bytes: number;
  seconds: number | null;
}

/** server → client: the answer to a `PingMessage`. */
export interface PongMessage {
  type: "pong";
}

/** RFC 9457. `type` names the kind, `detail` says what happened and what to do. */
export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  [extra: string]: unknown;
}

/** server → client: a message was refused; the look stays as it was. */
export interface ProblemMessage {
  type: "problem";
  revision: number | null;
  problem: Problem;
}

/** What was asked for, complete; `cameras` are those of the `views` that somebody placed. `probes`: null for fixed cameras. `patches`, `gather_rays`: null where the method chooses. */
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

/** How the functions of the Zernike basis follow from each other; see `relume.math.zernike.Recurrence`. */
export interface RecurrenceBody {
  order: number[];
  norm: number[];
  cosine: number[];
  sine: number[];
  a: number[];
  b: number[];
  c: number[];
}

/** A batch; `completed` of `total` frames are finished, `progress` 0…1 counts what is done of the next one too. `seconds_left`: null where it does not run or nothing was measured yet. `user` asked for it; "" where nobody logs in. `created`, `started` and `ended` are times; null: not yet. */
export interface RenderBody {
  id: string;
  name: string | null;
  user: string;
  bake: string;
  view: string;
  format: "exr" | "png" | "webp" | "mp4";
  size: [number, number] | null;
  state: "queued" | "running" | "ready" | "failed" | "stopped";
  created: string;
  started: string | null;
  ended: string | null;
  completed: number;
  total: number;
  progress: number;
  seconds_left: number | null;
  problem: string | null;
}

/** The room of a session. `id` opens it to edit, null for who only watches; `view_token` opens it to watch. `participant_token` comes back as the same person, `self_id` is their id. `is_new`: nobody was in it, so that it has the look that this session brings. `default_look`: the scene's own look, as everything is that nobody has edited. */
export interface RoomInfo {
  id: string | null;
  view_token: string;
  participant_token: string;
  self_id: number;
  is_new: boolean;
  people: Person[];
  default_look: Record<string, unknown>;
}

/** server → client: who is in the room now, of these oneself at `self_id`. */
export interface RoomMessage {
  type: "room";
  self_id: number;
  people: Person[];
}

/** server → client: what the room's look has become since the last such message, or `hello`, with this session's own edits up to `revision` in it. The `patch` is empty where there were no others. `room_revision` counts its changes, and frames say which they show. `edited_by`: ids of those who edited. */
export interface RoomUpdate {
  type: "room_update";
  revision: number;
  room_revision: number;
  patch: SharedOperation[];
  edited_by: number[];
}

/** A scene; `materials` in the order of the ids in `/views/{view}/materials.png`, `bakes` newest first. `warnings`: the worst first. */
export interface SceneBody {
  id: string;
  name: string;
  created: string;
  views: SceneView[];
  materials: SceneMaterial[];
  lights: string[];
  variants: SceneVariant[];
  warnings: SceneWarning[];
  triangles: number;
  thumbnail: string | null;
  bakes: string[];
}

/** A material and its default terms, in look-document form. `catcher`: it is the ground, which looks may show by its shadows alone. `is_projected`: most of its triangles have no texture coordinates, and take a projection. `is_glass`: light passes it, as the scene's file says and no look changes. */
export interface SceneMaterial {
  name: string;
  terms: Record<string, unknown>[];
  shadow_catcher: boolean;
  is_projected: boolean;
  is_glass: boolean;
}

/** What a shader needs for a look besides arrays. `gain`: of the picture; `environment_gain`, `background_gain`: of the prefiltered environment that lobes look up, and of the background, per channel. `environment_rotation`: added to u. `environment_mips`: first texel, height and width of each. `bright_lights`: of the environment, which lobes evaluate separately: direction, radiance, spread. `shows_direct`: direct light is shown, and with it the background. `arrays` are those of the payload; those that are not named are as they were. */
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

/** A look that came with the scene's file; partial, in look-document form. */
export interface SceneVariant {
  name: string;
  look: Record<string, unknown>;
}

/** A camera; `aspect` is width ÷ height. `is_placed`: somebody placed it, it did not come with the scene. */
export interface SceneView {
  name: string;
  aspect: number;
  is_placed: boolean;
}

/** A warning of the import. `severity`: what `text` is about is missing or wrong in the picture ("unsupported"), looks much the same ("approximated"), or does not change the picture ("ignored"). */
export interface SceneWarning {
  text: string;
  severity: "unsupported" | "approximated" | "ignored";
}

/** What a link shows; `missing`: what of it is not here any more, one sentence each. */
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

/** A link that was made; `url` is relative to the server. */
export interface ShareEntry {
  id: string;
  url: string;
}

/** One operation of what a shared look has become. A path may be there already where it says `add`, and gone where it says `remove`. */
export interface SharedOperation {
  op: "replace" | "add" | "remove";
  path: string;
  value: unknown;
}

/** server → client: something takes time; `progress` 0…1. A curve is precomputed for its edits (`label` names it), or a term is shaded because the picture has no image of it yet; "ready": that has ended. What does not wait for it goes on meanwhile. */
export interface StatusMessage {
  type: "status";
  state: "precomputing" | "shading" | "ready";
  view: string;
  label: string;
  progress: number;
}

/** A view of a display, as looks name it in `display.tone_map`. */
export interface ViewBody {
  display: string;
  view: string;
}

/** A view, its size in pixels and its camera; `camera_mode`: seen from where it was baked alone, or from anywhere. Then `bounds` are the lowest and the highest corner of what there is to see, metres. */
export interface ViewInfo {
  name: string;
  width: number;
  height: number;
  camera: CameraInfo;
  camera_mode: "fixed" | "free";
  bounds: [number[], number[]] | null;
}

/** The bounds of a scene, metres, and a camera that sees all of it. */
export interface ViewportBody {
  bounds_min: number[];
  bounds_max: number[];
  default_camera: CameraFrame;
}

/** How a term is sent in views whose eye moves: by so many `functions` of the incident light, with a `residual` (cosine-weighted relative RMS); `required_functions`: how many would miss a twentieth, null where more than these; `is_mirror`: as a blurred mirror instead. */
export interface ZernikeFitBody {
  functions: number;
  residual: number;
  required_functions: number | null;
  is_mirror: boolean;
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
  | CurveMessage
  | BakeMessage
  | DrainMessage
  | RoomMessage
  | RoomUpdate
  | CommentsMessage
  | PongMessage;
