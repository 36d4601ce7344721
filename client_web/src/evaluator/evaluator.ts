/** Draws moving views of one bake: points, then vertices, then pixels; what it holds of a look comes in tables. */
import { Program } from "../picture/gl";
import type { FrameHeader, SurfaceBody } from "../protocol";
import { COVER, GROUPS, MATERIAL, WIDTH } from "./common";
import { pointShader, vertexShader } from "./pointShader";
import { read } from "./reading";
import { isSoftware } from "./software";
import { backgroundShader, CORNERS, surfaceShader, WORDS } from "./surfaceShader";
import { Images, Values } from "./targets";
import { BYTES, Texels, type Kind } from "./texels";

type Tables = NonNullable<FrameHeader["tables"]>;

/** Where an eye is, as the protocol says it. */
export interface Camera {
  to_world: readonly number[];
  /** Radians. */
  yfov: number;
}

/** A drawn picture: words of RGB9_E5 and, where the background is transparent, how much each pixel hides. */
export interface Drawn {
  width: number;
  height: number;
  words: Uint8Array;
  hides: Uint8Array | null;
}

/** Numbers a texel of what never changes; the server says only what there is. */
const KEPT: Record<string, [Kind, number]> = {
  corners: ["uint32", 4],
  lattice: ["uint32", 4],
  facing: ["float32", 4],
  positions: ["float32", 4],
  nodes: ["uint32", 1],
  normals: ["float32", 4],
  points: ["uint32", 4],
  weights: ["float32", 4],
  places: ["float32", 4],
  point_normals: ["float32", 4],
  tangents: ["float32", 4],
  sky_share: ["float16", 4],
  uvs: ["float32", 4],
  texels: ["float16", 4],
  levels: ["uint32", 4],
};
const SAMPLES = 4; // a pixel; a processor that draws has no time for them
const NEAREST = 1e-4; // of the size of the scene, to the nearest that is seen
const FARTHEST = 100;

/** A sampler's uniform by its array's name: uSkyShare of sky_share. */
const uniform = (name: string) => `u${name.replace(/(^|_)(.)/g, (_, __, letter: string) => letter.toUpperCase())}`;

export class Evaluator {
  private readonly gl: WebGL2RenderingContext;
  private readonly texels: Texels;
  private readonly programs: { background: Program; words: Program };
  private readonly samples: number;
  private readonly compiled = new Map<string, Program>();
  private readonly hasTextures: boolean;
  private hasGroups = false;
  private readonly ofPoints: Values;
  private readonly ofVertices: Values;
  private readonly size: number;
  private images: Images | null = null;
  private numbers: Tables | null = null;
  private sky = new Uint8Array();
  private blurred = new Uint8Array();
  /** Which of both lies behind surfaces. */
  private map = new Uint8Array();
  private scales = { vectors: [1, 0], others: [1, 0] };

  /** Throws where this browser cannot draw it. */
  constructor(
    gl: WebGL2RenderingContext,
    private readonly surface: SurfaceBody,
    arrays: ReadonlyMap<string, Uint8Array>,
  ) {
    this.gl = gl;
    if (gl.getExtension("EXT_color_buffer_float") === null) throw new Error("this browser draws no floating-point images");
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.texels = new Texels(gl);
    for (const [name, bytes] of arrays) {
      const kept = KEPT[name];
      if (kept !== undefined) this.texels.put(name, ...kept, bytes);
    }
    this.hasTextures = arrays.has("texels");
    this.samples = isSoftware(gl) ? 0 : SAMPLES;
    const count = (name: string) => this.texels.count(name);
    this.programs = {
      background: new Program(gl, COVER, backgroundShader(this.samples === 0)),
      words: new Program(gl, COVER, WORDS),
    };
    this.ofPoints = new Values(gl, count("places"));
    this.ofVertices = new Values(gl, count("normals"));
    this.size = sizeOf(arrays.get("positions") ?? new Uint8Array());
  }

  /** Whether there is a look to be drawn. */
  get isReady(): boolean {
    return this.numbers !== null && !this.gl.isContextLost();
  }

  /** Give the context back: a browser has few of them. */
  release(): void {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  /** Follow a look: arrays that have changed, and all numbers. */
  take(tables: Tables, payload: Uint8Array): void {
    let start = 0;
    for (const { name, dtype, shape } of tables.arrays) {
      const bytes = payload.subarray(start, (start += shape[0] * shape[1] * BYTES[dtype]));
      if (name === "vectors_scale" || name === "others_scale") {
        this.scales[name === "vectors_scale" ? "vectors" : "others"] = [...new Float32Array(bytes.slice().buffer)];
        continue;
      }
      if (name === "background") this.blurred = bytes.slice();
      else this.texels.put(name, name === "sky" ? "rgb9e5" : dtype, shape[1], bytes);
      if (name === "sky") this.sky = bytes.slice();
      if (name === "materials") this.hasGroups = sendsByGroups(new Int32Array(bytes.slice().buffer));
    }
    const map = tables.background === "blurred" ? this.blurred : this.sky;
    if (isMap(tables) && map !== this.map) {
      const [height, width] = tables.background_size;
      this.texels.putMap("background", width, height, map);
      this.map = map;
    }
    this.numbers = tables;
  }

  /** The picture from an eye; throws where the context was lost. */
  async draw(camera: Camera, width: number, height: number): Promise<Drawn> {
    const { gl, numbers } = this;
    if (numbers === null) throw new Error("there is no look yet");
    if (this.images?.width !== width || this.images.height !== height) {
      this.images?.dispose();
      this.images = new Images(gl, width, height, this.samples);
    }
    const images = this.images;
    gl.disable(gl.DEPTH_TEST);
    this.drawPoints(camera, numbers);
    this.drawVertices();
    this.drawPixels(camera, numbers, images);
    if (images.radiance !== null) this.drawWords(images, images.radiance);
    const [words, hides] = await read(gl, images.words, numbers.background === "transparent" ? 2 : 1, width, height);
    if (gl.isContextLost() || words === undefined) throw new Error("the graphics context was lost");
    return { width, height, words, hides: hides?.filter((_, index) => index % 4 === 0) ?? null };
  }

  private drawPoints(camera: Camera, numbers: Tables): void {
    const { gl } = this;
    const features = { uneven: this.texels.count("uneven") > 0, lobes: this.hasLobes, maps: this.hasTextures };
    const made = this.program(features, () => new Program(gl, COVER, pointShader(this.surface, features)));
    const program = this.use(made, ["vectors", "others", "sky_share", "places", "point_normals", "tangents", "even", "uneven", "lobes", "materials", "sky"]);
    gl.uniform1i(program.at("uNumPoints"), this.texels.count("places"));
    gl.uniform1i(program.at("uStride"), this.scales.vectors[1] as number);
    gl.uniform1f(program.at("uScale"), this.scales.vectors[0] as number);
    gl.uniform1i(program.at("uOthersStride"), this.scales.others[1] as number);
    gl.uniform1f(program.at("uOthersScale"), this.scales.others[0] as number);
    this.saySky(program, numbers);
    gl.uniform3fv(program.at("uEye"), placeOf(camera));
    this.cover(this.ofPoints.buffer, WIDTH, this.ofPoints.rows);
  }

  private drawVertices(): void {
    const { gl } = this;
    const layers = [0, ...(this.hasGroups ? [1] : []), ...(this.hasGroups || this.hasTextures ? [2] : []), ...(this.hasLobes ? [3] : [])];
    const made = this.program({ layers }, () => new Program(gl, COVER, vertexShader(layers)));
    const program = this.use(made, ["points", "weights"]);
    this.bindValues(program, this.ofPoints, 2);
    gl.uniform1i(program.at("uNumVertices"), this.texels.count("normals"));
    this.cover(this.ofVertices.buffer, WIDTH, this.ofVertices.rows);
  }

  private drawPixels(camera: Camera, numbers: Tables, images: Images): void {
    const { gl } = this;
    const { width, height } = images;
    const [half, direct] = [Math.tan(camera.yfov / 2), this.samples === 0];
    const [across, up] = [(half * width) / height, direct ? -half : half]; // words have their top row first
    const [right, above, back] = [0, 1, 2].map((k) => [0, 1, 2].map((row) => camera.to_world[4 * row + k] as number)) as [number[], number[], number[]];
    const scaled = (axis: number[], by: number) => axis.map((value) => value * by);

    const features = { groups: this.hasGroups, textures: this.hasTextures, lobes: this.hasLobes, catchers: this.texels.count("unhidden") > 0, direct };
    const made = this.program(features, () => new Program(gl, CORNERS, surfaceShader(this.surface, features)));
    const program = this.use(made, ["corners", "lattice", "facing", "nodes", "normals", "points", "weights", "unhidden", "materials", "lobes", "sky", "levels", "texels", "uvs", "background", "positions"]);
    this.bindValues(program, this.ofVertices, 17);
    this.sayBehind(program, numbers);
    const [near, far] = [NEAREST * this.size, FARTHEST * this.size];
    gl.uniform4f(program.at("uFrustum"), 1 / across, 1 / up, (far + near) / (near - far), (2 * far * near) / (near - far));
    gl.uniformMatrix3fv(program.at("uRotation"), false, [...right, ...above, ...back]);
    gl.uniform3fv(program.at("uEye"), placeOf(camera));
    gl.uniform1f(program.at("uPixelAngle"), camera.yfov / height);
    gl.uniform3fv(program.at("uGain"), numbers.gain);
    this.saySky(program, numbers);
    gl.bindFramebuffer(gl.FRAMEBUFFER, images.drawn);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.drawArrays(gl.TRIANGLES, 0, 3 * this.texels.count("corners"));

    const background = this.use(this.programs.background, ["background"]);
    this.sayBehind(background, numbers);
    gl.uniformMatrix3fv(background.at("uRays"), false, [...scaled(right, across), ...scaled(above, up), ...scaled(back, -1)]);
    gl.uniform2f(background.at("uSize"), width, height);
    this.cover(images.drawn, width, height);
    gl.disable(gl.DEPTH_TEST);
  }

  private drawWords(images: Images, radiance: WebGLTexture): void {
    const { gl } = this;
    const { words } = this.programs;
    images.resolve();
    gl.useProgram(words.handle);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, radiance);
    gl.uniform1i(words.at("uImage"), 0);
    this.cover(images.words, images.width, images.height);
  }

  private get hasLobes(): boolean {
    return this.texels.count("lobes") > 0;
  }

  /** A variant of a program, compiled when it is first needed. */
  private program(features: object, make: () => Program): Program {
    const key = JSON.stringify(features);
    const known = this.compiled.get(key) ?? make();
    this.compiled.set(key, known);
    return known;
  }

  private use(program: Program, arrays: readonly string[]): Program {
    this.gl.useProgram(program.handle);
    arrays.forEach((name, unit) => {
      this.gl.uniform1i(program.at(uniform(name)), unit);
      this.texels.bind(name, unit);
    });
    return program;
  }

  private bindValues(program: Program, values: Values, unit: number): void {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, values.texture);
    gl.uniform1i(program.at("uValues"), unit);
  }

  private saySky(program: Program, numbers: Tables): void {
    const { gl } = this;
    gl.uniform3fv(program.at("uSkyGain"), numbers.sky_gain);
    gl.uniform3iv(program.at("uSkyLevels"), numbers.sky_levels.slice(0, 8).flat());
    gl.uniform1i(program.at("uNumSkyLevels"), Math.min(8, numbers.sky_levels.length));
    gl.uniform1f(program.at("uTurn"), numbers.sky_turn);
  }

  private sayBehind(program: Program, numbers: Tables): void {
    const { gl } = this;
    gl.uniform3fv(program.at("uBackgroundGain"), isMap(numbers) ? numbers.background_gain : [0, 0, 0]);
    gl.uniform3fv(program.at("uBackgroundColor"), numbers.background === "color" ? numbers.background_color : [0, 0, 0]);
    gl.uniform1f(program.at("uTurn"), numbers.sky_turn);
    gl.uniform1f(program.at("uFree"), numbers.is_direct ? 1 : 0);
  }

  private cover(buffer: WebGLFramebuffer, width: number, height: number): void {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    gl.viewport(0, 0, width, height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}

const isMap = ({ background }: Tables): boolean => background === "map" || background === "blurred";

const placeOf = ({ to_world }: Camera): [number, number, number] => [to_world[3] as number, to_world[7] as number, to_world[11] as number];

/** Whether any material sends anything by another group than the first. */
function sendsByGroups(rows: Int32Array): boolean {
  for (let k = 0; k < rows.length; k += 4 * MATERIAL) {
    for (let group = 1; group < GROUPS; group++) if ((rows[k + 4 * group + 2] as number) > 0) return true;
  }
  return false;
}

/** The diagonal of the box about all corners. */
function sizeOf(positions: Uint8Array): number {
  const all = new Float32Array(positions.buffer, positions.byteOffset, positions.byteLength / 4);
  const [lowest, highest] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  for (let k = 0; k < all.length; k += 4) {
    for (let axis = 0; axis < 3; axis++) {
      lowest[axis] = Math.min(lowest[axis] as number, all[k + axis] as number);
      highest[axis] = Math.max(highest[axis] as number, all[k + axis] as number);
    }
  }
  return Math.max(1e-6, Math.hypot(...lowest.map((low, axis) => (highest[axis] as number) - low)));
}
