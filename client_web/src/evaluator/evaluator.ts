/** Draws moving views of one bake: points, then slots, then pixels; what it holds of a look comes in tables. */
import { Program } from "../picture/gl";
import type { FrameHeader, SurfaceBody } from "../protocol";
import { COVER, LAMPS, rectanglesOf, SKY_LEVELS } from "./common";
import { classesOf, layersOf, readMaterials, type FaceClass, type Material } from "./materials";
import { pointShader, slotShader } from "./pointShader";
import { read } from "./reading";
import { isSoftware } from "./software";
import { backgroundShader, cornerShader, surfaceShader, wordsShader, type PictureFeatures } from "./surfaceShader";
import { Images, LAYERS, Values } from "./targets";
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
  sides: ["uint32", 4],
  facing: ["float32", 4],
  positions: ["float32", 4],
  normals: ["float16", 4],
  points: ["uint32", 4],
  weights: ["float16", 4],
  places: ["float32", 4],
  point_normals: ["float16", 4],
  tangents: ["float16", 4],
  seen_lights: ["uint32", 4],
  uvs: ["float32", 4],
  texels: ["float16", 4],
  levels: ["uint32", 4],
};
/** What points ask for, beside light vectors. */
const OF_POINTS = ["places", "point_normals", "tangents", "even", "uneven", "lobes", "sky", "seen_lights", "lobe_lights", "lobe_lists", "lobe_firsts", "lights_of_lamps", "sky_lights"];
const SAMPLES = 4; // a pixel
const NEAREST = 1e-4; // of the size of the scene, to the nearest that is seen
const FARTHEST = 100;

/** A sampler's uniform by its array's name: uSeenLights of seen_lights. */
const uniform = (name: string) => `u${name.replace(/(^|_)(.)/g, (_, __, letter: string) => letter.toUpperCase())}`;

export class Evaluator {
  private readonly gl: WebGL2RenderingContext;
  private readonly texels: Texels;
  /** A processor draws, which has no time for several samples a pixel. */
  readonly isSoftware: boolean;
  private readonly samples: number;
  private readonly compiled = new Map<string, Program>();
  private readonly ofPoints: Values;
  private readonly ofSlots: Values;
  /** The material of each face. */
  private readonly faceMaterial: Uint32Array;
  private readonly size: number;
  private images: Images | null = null;
  private numbers: Tables | null = null;
  private materials: Material[] = [];
  private faces: (FaceClass & { buffer: WebGLBuffer })[] = [];
  private layers: number[] = [0];
  /** What materials were read from. */
  private rows = { materials: new Uint8Array(), lobes: new Uint8Array() };
  private sky = new Uint8Array();
  private blurred = new Uint8Array();
  /** Which of both lies behind surfaces. */
  private map = new Uint8Array();
  /** By how much light vectors were divided, and how many functions they have, by their names. */
  private readonly scales = new Map<string, readonly number[]>();

  /** Throws where this browser cannot draw it. */
  constructor(
    gl: WebGL2RenderingContext,
    private readonly surface: SurfaceBody,
    arrays: ReadonlyMap<string, Uint8Array>,
  ) {
    this.gl = gl;
    if (gl.getExtension("EXT_color_buffer_float") === null) throw new Error("this browser draws no floating-point images");
    if (gl.getParameter(gl.MAX_DRAW_BUFFERS) < LAYERS) throw new Error("this browser draws into too few images at once");
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.texels = new Texels(gl);
    for (const [name, bytes] of arrays) this.keep(name, bytes);
    this.isSoftware = isSoftware(gl);
    this.samples = this.isSoftware ? 0 : SAMPLES;
    const count = (name: string) => this.texels.count(name);
    this.ofPoints = new Values(gl, count("places"));
    this.ofSlots = new Values(gl, count("normals"));
    this.faceMaterial = wordsOf(arrays.get("corners") ?? new Uint8Array()).filter((_, index) => index % 4 === 3);
    this.size = sizeOf(arrays.get("positions") ?? new Uint8Array());
  }

  /** Keep an array of what never changes. */
  keep(name: string, bytes: Uint8Array): void {
    const kept = KEPT[name];
    if (kept !== undefined) this.texels.put(name, ...kept, bytes);
  }

  /** Whether there is a look to be drawn. */
  get isReady(): boolean {
    return this.numbers !== null && !this.lacksSeenLights && !this.isLost;
  }

  get isLost(): boolean {
    return this.gl.isContextLost();
  }

  /** Whether the look has lobes, which ask for an array that is not there yet. */
  get lacksSeenLights(): boolean {
    return this.layers.includes(3) && this.texels.count("seen_lights") === 0;
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
      if (name.endsWith("/scale")) {
        this.scales.set(name, [...new Float32Array(bytes.slice().buffer)]);
        continue;
      }
      if (name === "background") this.blurred = bytes.slice();
      else this.texels.put(name, name === "sky" ? "rgb9e5" : dtype, shape[1], bytes);
      if (name === "sky") this.sky = bytes.slice();
      if (name === "materials" || name === "lobes") this.rows[name] = bytes.slice();
    }
    const map = tables.background === "blurred" ? this.blurred : this.sky;
    if (isMap(tables) && map !== this.map) {
      const [height, width] = tables.background_size;
      this.texels.putMap("background", width, height, map);
      this.map = map;
    }
    this.takeMaterials();
    this.numbers = tables;
  }

  /** What materials make use of, and which faces show what. */
  private takeMaterials(): void {
    const { gl, rows, scales } = this;
    const before = JSON.stringify(this.materials.map(({ pixels }) => pixels));
    this.materials = readMaterials(new Int32Array(rows.materials.buffer), (name, k) => scales.get(`${name}/${k}/scale`)?.[1] ?? 0);
    this.layers = layersOf(this.materials);
    if (JSON.stringify(this.materials.map(({ pixels }) => pixels)) === before) return;
    for (const { buffer } of this.faces) gl.deleteBuffer(buffer);
    this.faces = classesOf(this.materials, this.faceMaterial).map((one) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, one.corners, gl.STATIC_DRAW);
      return { ...one, buffer };
    });
  }

  /** The picture from an eye; throws where the context was lost. */
  async draw(camera: Camera, width: number, height: number): Promise<Drawn> {
    const { gl, numbers } = this;
    if (numbers === null) throw new Error("there is no look yet");
    const hides = numbers.background === "transparent";
    if (this.images?.width !== width || this.images.height !== height || this.images.hides !== hides) {
      this.images?.dispose();
      this.images = new Images(gl, width, height, this.samples, hides);
    }
    const images = this.images;
    gl.disable(gl.DEPTH_TEST);
    this.drawPoints(camera, numbers);
    this.drawSlots();
    this.drawPixels(camera, numbers, images);
    if (images.radiance !== null) this.drawWords(images, images.radiance);
    const [words, hiding] = await read(gl, images.words, hides ? 2 : 1, width, height);
    if (gl.isContextLost() || words === undefined) throw new Error("the graphics context was lost");
    return { width, height, words, hides: hiding?.filter((_, index) => index % 4 === 0) ?? null };
  }

  private drawPoints(camera: Camera, numbers: Tables): void {
    const { gl, layers, surface } = this;
    this.ofPoints.begin(layers);
    gl.enable(gl.SCISSOR_TEST);
    this.materials.forEach(({ points, tables, lobe }, k) => {
      const [first, end] = [surface.first_points[k] as number, surface.first_points[k + 1] as number];
      if (first === end) return;
      const made = this.program({ points, layers }, () => new Program(gl, COVER, pointShader(surface, points, layers)));
      const program = this.use(made, OF_POINTS);
      this.bindVectors(program, "vectors", k, OF_POINTS.length);
      this.bindVectors(program, "others", k, OF_POINTS.length + 1);
      this.texels.bind(`shapes/${k}`, OF_POINTS.length + 2);
      gl.uniform1i(program.at("uShapes"), OF_POINTS.length + 2);
      gl.uniform1i(program.at("uFirst"), first);
      gl.uniform2iv(program.at("uTables"), tables.plain);
      gl.uniform4iv(program.at("uHighlights"), tables.highlights);
      gl.uniform1i(program.at("uLobe"), lobe);
      gl.uniform1i(program.at("uSeenTexels"), this.texels.count("seen_lights") / Math.max(1, surface.first_points[surface.first_points.length - 1] as number));
      gl.uniform3fv(program.at("uEye"), placeOf(camera));
      this.saySky(program, numbers);
      for (const rectangle of rectanglesOf(first, end)) {
        gl.scissor(...rectangle);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
      }
    });
    gl.disable(gl.SCISSOR_TEST);
  }

  private bindVectors(program: Program, name: string, material: number, unit: number): void {
    const { gl } = this;
    const array = `${name}/${material}`;
    this.texels.bind(array, unit);
    gl.uniform1i(program.at(uniform(name)), unit);
    gl.uniform1f(program.at(name === "vectors" ? "uScale" : "uOthersScale"), this.scales.get(`${array}/scale`)?.[0] ?? 1);
  }

  private drawSlots(): void {
    const { gl, layers } = this;
    const made = this.program({ slots: layers }, () => new Program(gl, COVER, slotShader(layers)));
    const program = this.use(made, ["points", "weights"]);
    this.bindValues(program, this.ofPoints, 2);
    this.ofSlots.begin(layers);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  private drawPixels(camera: Camera, numbers: Tables, images: Images): void {
    const { gl } = this;
    const { width, height, hides } = images;
    const [half, direct] = [Math.tan(camera.yfov / 2), this.samples === 0];
    const [across, up] = [(half * width) / height, direct ? -half : half]; // words have their top row first
    const [right, above, back] = [0, 1, 2].map((k) => [0, 1, 2].map((row) => camera.to_world[4 * row + k] as number)) as [number[], number[], number[]];
    const scaled = (axis: number[], by: number) => axis.map((value) => value * by);
    const features: PictureFeatures = { map: isMap(numbers), hides, direct };

    gl.bindFramebuffer(gl.FRAMEBUFFER, images.drawn);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    const [near, far] = [NEAREST * this.size, FARTHEST * this.size];
    for (const faces of this.faces) {
      const program = this.useFor(faces, features);
      this.sayBehind(program, numbers);
      gl.uniform4f(program.at("uFrustum"), 1 / across, 1 / up, (far + near) / (near - far), (2 * far * near) / (near - far));
      gl.uniformMatrix3fv(program.at("uRotation"), false, [...right, ...above, ...back]);
      gl.uniform3fv(program.at("uEye"), placeOf(camera));
      gl.uniform1f(program.at("uPixelAngle"), camera.yfov / height);
      gl.uniform3fv(program.at("uGain"), numbers.gain);
      this.saySky(program, numbers);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, faces.buffer);
      gl.drawElements(gl.TRIANGLES, faces.corners.length, gl.UNSIGNED_INT, 0);
    }

    const background = this.use(this.program({ background: features }, () => new Program(gl, COVER, backgroundShader(features))), ["background"]);
    this.sayBehind(background, numbers);
    gl.uniformMatrix3fv(background.at("uRays"), false, [...scaled(right, across), ...scaled(above, up), ...scaled(back, -1)]);
    gl.uniform2f(background.at("uSize"), width, height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.disable(gl.DEPTH_TEST);
  }

  /** The program that draws faces of a kind. */
  private useFor({ shows }: FaceClass, picture: PictureFeatures): Program {
    const { gl, surface } = this;
    const features = { ...shows, ...picture };
    const made = this.program({ features }, () => new Program(gl, cornerShader(shows), surfaceShader(surface, features)));
    const program = this.use(made, ["corners", "sides", "facing", "normals", "points", "weights", "unhidden", "materials", "lobes", "sky", "levels", "texels", "uvs", "background", "positions"]);
    this.bindValues(program, this.ofSlots, 15);
    return program;
  }

  private drawWords(images: Images, radiance: WebGLTexture): void {
    const { gl } = this;
    const words = this.program({ words: images.hides }, () => new Program(gl, COVER, wordsShader(images.hides)));
    images.resolve();
    gl.useProgram(words.handle);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, radiance);
    gl.uniform1i(words.at("uImage"), 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, images.words);
    gl.viewport(0, 0, images.width, images.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
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
    gl.uniform3iv(program.at("uSkyLevels"), numbers.sky_levels.slice(0, SKY_LEVELS).flat());
    gl.uniform1i(program.at("uNumSkyLevels"), Math.min(SKY_LEVELS, numbers.sky_levels.length));
    gl.uniform1f(program.at("uTurn"), numbers.sky_turn);
    const lamps = numbers.lamps.slice(0, LAMPS);
    gl.uniform1i(program.at("uNumLamps"), lamps.length);
    if (lamps.length === 0) return;
    gl.uniform4fv(program.at("uLampDirections"), lamps.flatMap(([x, y, z, , , , spread]) => [x, y, z, spread]));
    gl.uniform3fv(program.at("uLampLights"), lamps.flatMap(([, , , ...light]) => light.slice(0, 3)));
  }

  private sayBehind(program: Program, numbers: Tables): void {
    const { gl } = this;
    gl.uniform3fv(program.at("uBackgroundGain"), numbers.background_gain);
    gl.uniform3fv(program.at("uBackgroundColor"), numbers.background === "color" ? numbers.background_color : [0, 0, 0]);
    gl.uniform1f(program.at("uTurn"), numbers.sky_turn);
    gl.uniform1f(program.at("uFree"), numbers.is_direct ? 1 : 0);
  }
}

const isMap = ({ background }: Tables): boolean => background === "map" || background === "blurred";

const placeOf = ({ to_world }: Camera): [number, number, number] => [to_world[3] as number, to_world[7] as number, to_world[11] as number];

const wordsOf = (bytes: Uint8Array): Uint32Array => new Uint32Array(bytes.slice().buffer);

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
