// Written by `python -m relume_server.typescript` from the server's models. Do not edit.


/** The background, visible behind all surfaces; it lights nothing. The environment map, the same `blurred` by an angle in degrees, one `color` (radiance), or transparent. */
export interface BackgroundLook {
  kind: "map" | "blurred" | "color" | "transparent";
  color: [number, number, number];
  blur: number;
}

/** Light from infinity that travels along `direction`; emission is irradiance perpendicular to it, W/m². `angle`: diameter of the disk that it comes from, degrees; 0 for parallel light. */
export interface DirectionalLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "directional";
  direction: [number, number, number];
  angle: number;
}

/** Many directional lights of the scene as one source, its `source`; emission is their mean irradiance. */
export interface DirectionalsLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "directionals";
  source: string;
}

/** A disc that emits toward `direction`; emission is radiance. The camera does not see it. `radius`: meters. */
export interface DiscLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "disc";
  position: [number, number, number];
  direction: [number, number, number];
  radius: number;
}

/** Conversion from radiance to display: white balance, `exposure` in stops, then `contrast`, then the tone map or an OpenColorIO view, then a LUT of display values. `temperature`: of the light that shows as white, kelvin; 6500 leaves colors unchanged. `tint`: a positive one takes green out. `contrast`: slope of log radiance about middle gray; 1 leaves it unchanged. `lut`: "lut:<id>" of an uploaded LUT; null: none. */
export interface DisplayLook {
  exposure: number;
  tone_map: "agx" | "filmic" | "none" | OcioView;
  temperature: number;
  tint: number;
  contrast: number;
  lut: string | null;
}

/** A curve drawn by hand: `points`, [degrees, value], or `bands`, J values for all channels or 3 × J; or a change of that curve or of the generated one: `factors` and `offsets` per band, `handles`, [degrees, was, becomes]. */
export interface DrawnCurve {
  points?: [number, number][];
  bands?: number[] | number[][];
  factors?: number[] | number[][];
  offsets?: number[] | number[][];
  handles?: [number, number, number][];
  channels?: string;
}

/** The environment: multiplied by `intensity` and `color`, rotated about +Y by `rotation` degrees, counterclockwise from above. `map` names it, see `relume.assets.environments`; None: the scene's own. `link`: the surfaces that it lights; None: all. */
export interface EnvironmentLook {
  map: string | null;
  intensity: number;
  color: [number, number, number];
  rotation: number;
  link?: IncludeLink | ExcludeLink | null;
}

/** All surfaces but these. */
export interface ExcludeLink {
  exclude: SurfaceNames;
}

/** Light through a surface of glass; its material's terms are what it reflects. `color`: transmittance of one passage, without reflection. `absorption`: coefficients inside a solid, per meter; not of thin glass. `roughness`: as the transmitted light shows it, the square root of the width of GGX facets. `ior`: index of refraction. */
export interface GlassLook {
  color: [number, number, number];
  absorption?: [number, number, number];
  roughness: number;
  ior: number;
}

/** Only these surfaces. */
export interface IncludeLink {
  include: SurfaceNames;
}

/** A group of lights: `intensity` and `color` multiply their gains; a disabled group turns them off. */
export interface LightGroupLook {
  lights: string[];
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
}

/** A complete, valid look, made by `relume.look.validate`. */
export interface Look {
  materials: Record<string, MaterialLook>;
  environment: EnvironmentLook;
  background: BackgroundLook;
  lights: Record<string, PointLook | SpotLook | DirectionalLook | RectangleLook | DiscLook | SphereLook | TubeLook | MeshLook | PointsLook | PanelsLook | DirectionalsLook | SurfacesLook>;
  light_groups: Record<string, LightGroupLook>;
  transport: TransportLook;
  display: DisplayLook;
}

/** A material: the sum of its terms. A `shadow_catcher` hides its terms: it shows the background times the ratio of light with and without the objects. `normal_map` replaces the scene's own. `uv` transforms the texture coordinates of all its images. `glass`: only materials that transmit light in the scene have it. `basis_functions`: while a free camera moves, all terms are the sum of this many functions of the in-out factorization, without separate highlights, to compare; null: as many as each term needs, highlights separate. `base` and `objects`: of a material that the look adds; it is that of these objects instead of the scene's material `base`. Null for materials of the scene. */
export interface MaterialLook {
  terms: TermLook[];
  shadow_catcher?: boolean;
  normal_map?: NormalMapLook | null;
  uv?: UvLook | null;
  glass?: GlassLook | null;
  basis_functions?: 1 | 3 | 6 | 10 | 15 | 21 | 28 | 36 | null;
  base?: string | null;
  objects?: string[];
}

/** All surfaces of a material emit and are visible; emission is radiance. `image`: an uploaded image, "image:<id>", by which they emit: radiance is emission times its linear RGB. None: they emit as in the scene. */
export interface MeshLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "mesh";
  material: string;
  image?: string | null;
}

/** An uploaded image that replaces a material's normal map: "image:<id>", and its strength as glTF's `scale`. */
export interface NormalMapLook {
  image: string;
  scale?: number;
}

/** A view of a display of the server's OpenColorIO config, instead of a tone map. */
export interface OcioView {
  display: string;
  view: string;
}

/** Many area lights of the scene as one source, its `source`; emission is their mean radiance by area. */
export interface PanelsLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "panels";
  source: string;
}

/** A point light that emits equally in all directions; emission is radiant intensity, W/sr. `profile`: an uploaded IES file, "ies:<id>", by which it emits: intensity is emission times the file's over its maximum. `direction`: its nadir. `rotation`: of its C0 about that, degrees; at 0, C0 of a light that points down is +X, C90 −Z. None: equally in all directions. */
export interface PointLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "point";
  position: [number, number, number];
  direction?: [number, number, number];
  rotation?: number;
  profile?: string | null;
}

/** Many point and spot lights of the scene as one source, its `source`; emission is their mean intensity, W/sr. */
export interface PointsLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "points";
  source: string;
}

/** A rectangular area light that emits toward `direction`; emission is radiance. The camera does not see it. `rotation` rotates it about `direction`, degrees; at 0 its height lies in the plane of `direction` and +Y, or of +Z if `direction` is vertical. `size`: width and height, meters. */
export interface RectangleLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "rectangle";
  position: [number, number, number];
  direction: [number, number, number];
  rotation: number;
  size: [number, number];
}

/** A sphere; emission is radiance. The camera does not see it. `radius`: meters. */
export interface SphereLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "sphere";
  position: [number, number, number];
  radius: number;
}

/** A point light with inner and outer cone half-angles in degrees; emission is intensity on the axis, W/sr. `gobo`: an uploaded image, "image:<id>", in the square about the cone; its linear RGB multiplies the intensity. `profile`: as of a point light. `rotation`: of both about the direction, degrees. */
export interface SpotLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "spot";
  position: [number, number, number];
  direction: [number, number, number];
  cone: [number, number];
  rotation?: number;
  profile?: string | null;
  gobo?: string | null;
}

/** Surfaces by name: all of some materials, and all of some objects. Objects are the meshes of the scene. */
export interface SurfaceNames {
  materials?: string[];
  objects?: string[];
}

/** All surfaces of several materials of the scene as one source; emission is their mean radiance by area. `materials`: each with its radiance over the mean, for each channel. */
export interface SurfacesLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "surfaces";
  materials: [string, [number, number, number]][];
}

/** One term: color · texture · quotient · Π curves. Drawn curves replace those generated from `params`. `data`: name of the measured material, only for models that need one. `roughness_map`: scales the width of the highlight: "roughness" for the material's own map, "image:<id>" for an uploaded one, null for none. `texture`: a texture channel of the material, or an uploaded image. */
export interface TermLook {
  model: string;
  data?: string;
  color: [number, number, number];
  texture: string | null;
  roughness_map?: string | null;
  params: Record<string, number | [number, number, number]>;
  curves: Record<string, DrawnCurve | DrawnCurve[]>;
}

/** Light paths to show: all, direct, indirect, first bounce or further bounces, with at most `bounces` bounces. */
export interface TransportLook {
  show: "all" | "direct" | "indirect" | "first_bounce" | "further_bounces";
  bounces: number;
}

/** A tube, whose side emits and whose ends do not; emission is radiance. The camera does not see it. `position`: its middle. `direction`: its axis. `radius`, `length`: meters. */
export interface TubeLook {
  intensity: number;
  color: [number, number, number];
  enabled: boolean;
  emission: [number, number, number];
  link?: IncludeLink | ExcludeLink | null;
  shadow_link?: IncludeLink | ExcludeLink | null;
  kind: "tube";
  position: [number, number, number];
  direction: [number, number, number];
  radius: number;
  length: number;
}

/** Transform of a material's texture coordinates: `scale`, then `rotation` in degrees, then `offset`, as in glTF's KHR_texture_transform. See `relume.math.uv_transform`. */
export interface UvLook {
  scale?: [number, number];
  rotation?: number;
  offset?: [number, number];
}

export type LightLook =
  | PointLook
  | SpotLook
  | DirectionalLook
  | RectangleLook
  | DiscLook
  | SphereLook
  | TubeLook
  | MeshLook
  | PointsLook
  | PanelsLook
  | DirectionalsLook
  | SurfacesLook;

type LightsByKind = { readonly [K in LightLook["kind"]]: Extract<LightLook, { kind: K }> };

/** A light of each kind, complete. */
export const DEFAULT_LIGHTS: LightsByKind = {
  point: { kind: "point", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, position: [0, 1, 0], direction: [0, -1, 0], rotation: 0, profile: null },
  spot: { kind: "spot", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, position: [0, 1, 0], direction: [0, -1, 0], cone: [20, 30], rotation: 0, profile: null, gobo: null },
  directional: { kind: "directional", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, direction: [0, -1, 0], angle: 0 },
  rectangle: { kind: "rectangle", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, position: [0, 1, 0], direction: [0, -1, 0], rotation: 0, size: [0.5, 0.5] },
  disc: { kind: "disc", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, position: [0, 1, 0], direction: [0, -1, 0], radius: 0.25 },
  sphere: { kind: "sphere", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, position: [0, 1, 0], radius: 0.1 },
  tube: { kind: "tube", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, position: [0, 1, 0], direction: [1, 0, 0], radius: 0.02, length: 1 },
  mesh: { kind: "mesh", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, material: "", image: null },
  points: { kind: "points", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, source: "" },
  panels: { kind: "panels", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, source: "" },
  directionals: { kind: "directionals", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, source: "" },
  surfaces: { kind: "surfaces", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], link: null, shadow_link: null, materials: [] },
};

export const DEFAULTS: Readonly<Pick<Look, "environment" | "background" | "transport" | "display">> = {
  environment: { map: null, intensity: 1, color: [1, 1, 1], rotation: 0, link: null },
  background: { kind: "map", color: [0.5, 0.5, 0.5], blur: 10 },
  transport: { show: "all", bounces: 24 },
  display: { exposure: 0, tone_map: "agx", temperature: 6500, tint: 0, contrast: 1, lut: null },
};

/** Ranges of the numbers of each field. */
export const RANGES = {
  environment: { intensity: { minimum: 0, maximum: 10000 }, color: { minimum: 0, maximum: 10000 }, rotation: { minimum: -360, maximum: 360 } },
  background: { color: { minimum: 0, maximum: 10000 }, blur: { minimum: 2, maximum: 60 } },
  transport: { bounces: { minimum: 0, maximum: 24 } },
  display: { exposure: { minimum: -20, maximum: 20 }, temperature: { minimum: 2800, maximum: 15000 }, tint: { minimum: -50, maximum: 50 }, contrast: { minimum: 0.5, maximum: 2 } },
  light: { intensity: { minimum: 0, maximum: 10000 }, color: { minimum: 0, maximum: 10000 }, emission: { minimum: 0, maximum: 1000000000000 }, position: { minimum: -1000000000, maximum: 1000000000 }, direction: { minimum: -1000000000, maximum: 1000000000 }, rotation: { minimum: -360, maximum: 360 }, size: { minimum: 1e-08, maximum: 100000000 }, radius: { minimum: 0.0001, maximum: 10000 }, length: { minimum: 0.0001, maximum: 10000 }, angle: { minimum: 0, maximum: 30 }, cone: { minimum: 0, maximum: 90 } },
  glass: { color: { minimum: 0, maximum: 1 }, absorption: { minimum: 0, maximum: 1000000 }, roughness: { minimum: 0, maximum: 1 }, ior: { minimum: 1, maximum: 4 } },
  principled: { base_color: { minimum: 0, maximum: 1 }, metallic: { minimum: 0, maximum: 1 }, roughness: { minimum: 0.01, maximum: 1 }, specular: { minimum: 0, maximum: 1 }, specular_color: { minimum: 0, maximum: 10 }, ior: { minimum: 1, maximum: 4 }, anisotropy: { minimum: 0, maximum: 1 }, coat_weight: { minimum: 0, maximum: 1 }, coat_roughness: { minimum: 0.01, maximum: 1 }, sheen_weight: { minimum: 0, maximum: 1 }, sheen_color: { minimum: 0, maximum: 1 }, sheen_roughness: { minimum: 0.07, maximum: 1 }, transmission: { minimum: 0, maximum: 1 } },
  term: { color: { minimum: 0, maximum: 10000 } },
} as const;

export const MAX_TERMS = 16;
export const BASIS_FUNCTIONS = [1, 3, 6, 10, 15, 21, 28, 36];
export const MAX_LIGHTS = 64;
export const MAX_LIGHT_GROUPS = 64;
export const MAX_LIGHT_NAME = 80;
export const RESERVED_LIGHT_NAMES = ["environment", "__defineGetter__", "__defineSetter__", "__lookupGetter__", "__lookupSetter__", "__proto__", "constructor", "hasOwnProperty", "isPrototypeOf", "propertyIsEnumerable", "toLocaleString", "toString", "valueOf"];
export const MAX_CURVE_POINTS = 4096;
export const MAX_CURVE_VALUE = 1000000;
export const MAX_OPERATIONS = 256;
