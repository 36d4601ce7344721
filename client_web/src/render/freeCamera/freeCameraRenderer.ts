/** Draws free-camera views of one bake: probes, then lattice nodes, then pixels, from a look's tables. */
import { Program } from "../webgl";
import type { FrameHeader, FreeCameraBody } from "../../protocol";
import { FULLSCREEN_VERTEX, MAX_BRIGHT_LIGHTS, rectanglesOf, ENVIRONMENT_LEVELS } from "./dataLayout";
import { groupFaces, layersOfMaterials, readMaterials, type FaceClass, type RendererMaterial } from "./materials";
import { probeShader, latticeShader } from "./probeShader";
import { readPixels } from "./readback";
import { isSoftwareRenderer } from "./isSoftwareRenderer";
import { backgroundShader, cornerShader, surfaceShader, encodeShader, type ImageFeatures } from "./surfaceShader";
import { ImageTargets, LAYERS, ValueTarget } from "./renderTargets";
import { BYTES_PER_TEXEL, DataTextures, type TexelType } from "./dataTextures";

type Tables = NonNullable<FrameHeader["scene_update"]>;

/** A camera pose of the protocol. */
export interface RenderCamera {
  to_world: readonly number[];
  /** Radians. */
  yfov: number;
  /** Distance of the near clipping plane, meters; 0: nothing is clipped. */
  near: number;
}

/** A rendered image: RGB9_E5 pixels and, with a transparent background, the coverage of each. */
export interface RenderedImage {
  width: number;
  height: number;
  encoded: Uint8Array;
  coverage: Uint8Array | null;
}

/** Component type and count of the bake's constant arrays, which the server sends as plain bytes. */
const STORED_ARRAYS: Record<string, [TexelType, number]> = {
  corners: ["uint32", 4],
  sides: ["uint32", 4],
  facing: ["float32", 4],
  positions: ["float32", 4],
  normals: ["float16", 4],
  points: ["uint32", 4],
  weights: ["float16", 4],
  probe_positions: ["float32", 4],
  probe_normals: ["float16", 4],
  tangents: ["float16", 4],
  visible_lights: ["uint32", 4],
  uvs: ["float32", 4],
  texels: ["float16", 4],
  levels: ["uint32", 4],
};
/** Arrays of the probe shader, besides incident radiance coefficients. */
const PROBE_ARRAYS = [
  "probe_positions",
  "probe_normals",
  "tangents",
  "isotropic",
  "anisotropic",
  "lobes",
  "environment",
  "visible_lights",
  "lobe_lights",
  "lobe_lists",
  "lobe_firsts",
  "bright_light_members",
  "environment_lights",
];
const SAMPLES = 4; // per pixel
const NEAR_PLANE = 1e-4; // fraction of the scene's size, to the nearest visible point
const FAR_PLANE = 100;

/** Name of the sampler uniform of an array: uVisibleLights for visible_lights. */
const uniform = (name: string) => `u${name.replace(/(^|_)(.)/g, (_, __, letter: string) => letter.toUpperCase())}`;

/** The first byte of every pixel. */
function firstOfFour(pixels: Uint8Array): Uint8Array {
  const first = new Uint8Array(pixels.length / 4);
  for (let index = 0; index < first.length; index++) first[index] = pixels[4 * index] as number;
  return first;
}

export class FreeCameraRenderer {
  private readonly gl: WebGL2RenderingContext;
  private readonly texels: DataTextures;
  /** True if graphics are rendered on the CPU, which is too slow for several samples per pixel. */
  readonly isSoftware: boolean;
  private readonly samples: number;
  private readonly compiled = new Map<string, Program>();
  private readonly probeValues: ValueTarget;
  private readonly slotValues: ValueTarget;
  /** The material of each face. */
  private readonly faceMaterial: Uint32Array;
  private readonly size: number;
  private images: ImageTargets | null = null;
  private tables: Tables | null = null;
  private materials: RendererMaterial[] = [];
  private faces: (FaceClass & { buffer: WebGLBuffer })[] = [];
  private layers: number[] = [0];
  /** Material rows as last received. */
  private rows = { materials: new Uint8Array(), lobes: new Uint8Array() };
  private environment = new Uint8Array();
  private blurred = new Uint8Array();
  /** The background map in use: `environment` or `blurred`. */
  private map = new Uint8Array();
  /** Scale and number of functions of incident radiance coefficients, by array name. */
  private readonly scales = new Map<string, readonly number[]>();

  /** Throws if this browser cannot draw it. */
  constructor(
    gl: WebGL2RenderingContext,
    private readonly surface: FreeCameraBody,
    arrays: ReadonlyMap<string, Uint8Array>,
  ) {
    this.gl = gl;
    if (gl.getExtension("EXT_color_buffer_float") === null)
      throw new Error("This browser cannot render floating-point images");
    if (gl.getParameter(gl.MAX_DRAW_BUFFERS) < LAYERS) throw new Error("This browser supports too few render targets");
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.texels = new DataTextures(gl);
    for (const [name, bytes] of arrays) this.store(name, bytes);
    this.isSoftware = isSoftwareRenderer(gl);
    this.samples = this.isSoftware ? 0 : SAMPLES;
    const count = (name: string) => this.texels.count(name);
    this.probeValues = new ValueTarget(gl, count("probe_positions"));
    this.slotValues = new ValueTarget(gl, count("normals"));
    this.faceMaterial = encodedBytesOf(arrays.get("corners") ?? new Uint8Array()).filter((_, index) => index % 4 === 3);
    this.size = diagonalOf(arrays.get("positions") ?? new Uint8Array());
  }

  /** Upload a constant array of the bake. */
  store(name: string, bytes: Uint8Array): void {
    const layout = STORED_ARRAYS[name];
    if (layout !== undefined) this.texels.upload(name, ...layout, bytes);
  }

  /** True if a look can be drawn. */
  get isReady(): boolean {
    return this.tables !== null && !this.lacksVisibleLights && !this.isLost;
  }

  get isLost(): boolean {
    return this.gl.isContextLost();
  }

  /** True if the look has lobes, whose light visibility is not loaded yet. */
  get lacksVisibleLights(): boolean {
    return this.layers.includes(3) && this.texels.count("visible_lights") === 0;
  }

  /** Release the context: browsers limit their number. */
  dispose(): void {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  /** Apply a look's tables: changed arrays and all numbers. */
  setTables(tables: Tables, payload: Uint8Array): void {
    let start = 0;
    for (const { name, dtype, shape } of tables.arrays) {
      const bytes = payload.subarray(start, (start += shape[0] * shape[1] * BYTES_PER_TEXEL[dtype]));
      if (name.endsWith("/scale")) {
        this.scales.set(name, [...new Float32Array(bytes.slice().buffer)]);
        continue;
      }
      if (name === "background") this.blurred = bytes.slice();
      else this.texels.upload(name, name === "environment" ? "rgb9e5" : dtype, shape[1], bytes);
      if (name === "environment") this.environment = bytes.slice();
      if (name === "materials" || name === "lobes") this.rows[name] = bytes.slice();
    }
    const map = tables.background === "blurred" ? this.blurred : this.environment;
    if (isMap(tables) && map !== this.map) {
      const [height, width] = tables.background_size;
      this.texels.uploadMap("background", width, height, map);
      this.map = map;
    }
    this.setMaterials();
    this.tables = tables;
  }

  /** Read the features of the materials, and group faces by them. */
  private setMaterials(): void {
    const { gl, rows, scales } = this;
    const previous = JSON.stringify(this.materials.map(({ pixels }) => pixels));
    this.materials = readMaterials(
      new Int32Array(rows.materials.buffer),
      (name, k) => scales.get(`${name}/${k}/scale`)?.[1] ?? 0,
    );
    this.layers = layersOfMaterials(this.materials);
    if (JSON.stringify(this.materials.map(({ pixels }) => pixels)) === previous) return;
    for (const { buffer } of this.faces) gl.deleteBuffer(buffer);
    this.faces = groupFaces(this.materials, this.faceMaterial).map((faceClass) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faceClass.corners, gl.STATIC_DRAW);
      return { ...faceClass, buffer };
    });
  }

  /** Render the image of a camera; throws if the context was lost. */
  async draw(camera: RenderCamera, width: number, height: number): Promise<RenderedImage> {
    const { gl, tables } = this;
    if (tables === null) throw new Error("No look is loaded yet");
    const hasAlpha = tables.background === "transparent";
    if (this.images?.width !== width || this.images.height !== height || this.images.hasAlpha !== hasAlpha) {
      this.images?.dispose();
      this.images = new ImageTargets(gl, width, height, this.samples, hasAlpha);
    }
    const images = this.images;
    gl.disable(gl.DEPTH_TEST);
    this.drawProbes(camera, tables);
    this.drawSlots();
    this.drawPixels(camera, tables, images);
    if (images.radiance !== null) this.encodeRadiance(images, images.radiance);
    const [encoded, hiding] = await readPixels(gl, images.encoded, hasAlpha ? 2 : 1, width, height);
    if (gl.isContextLost() || encoded === undefined) throw new Error("The graphics context was lost");
    return { width, height, encoded, coverage: hiding === undefined ? null : firstOfFour(hiding) };
  }

  private drawProbes(camera: RenderCamera, numbers: Tables): void {
    const { gl, layers, surface } = this;
    this.probeValues.begin(layers);
    gl.enable(gl.SCISSOR_TEST);
    this.materials.forEach(({ points, tables, lobe }, k) => {
      const [first, end] = [surface.first_probes[k] as number, surface.first_probes[k + 1] as number];
      if (first === end) return;
      const compiled = this.program(
        { points, layers },
        () => new Program(gl, FULLSCREEN_VERTEX, probeShader(surface, points, layers)),
      );
      const program = this.use(compiled, PROBE_ARRAYS);
      this.bindVectors(program, "vectors", k, PROBE_ARRAYS.length);
      this.bindVectors(program, "others", k, PROBE_ARRAYS.length + 1);
      this.texels.bind(`shapes/${k}`, PROBE_ARRAYS.length + 2);
      gl.uniform1i(program.uniform("uShapes"), PROBE_ARRAYS.length + 2);
      gl.uniform1i(program.uniform("uFirst"), first);
      gl.uniform2iv(program.uniform("uTables"), tables.plain);
      gl.uniform4iv(program.uniform("uHighlights"), tables.highlights);
      gl.uniform1i(program.uniform("uLobe"), lobe);
      gl.uniform1i(
        program.uniform("uVisibilityTexels"),
        this.texels.count("visible_lights") /
          Math.max(1, surface.first_probes[surface.first_probes.length - 1] as number),
      );
      gl.uniform3fv(program.uniform("uCameraPosition"), positionOf(camera));
      this.setEnvironmentUniforms(program, numbers);
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
    gl.uniform1i(program.uniform(uniform(name)), unit);
    gl.uniform1f(
      program.uniform(name === "vectors" ? "uScale" : "uOthersScale"),
      this.scales.get(`${array}/scale`)?.[0] ?? 1,
    );
  }

  private drawSlots(): void {
    const { gl, layers } = this;
    const compiled = this.program({ slots: layers }, () => new Program(gl, FULLSCREEN_VERTEX, latticeShader(layers)));
    const program = this.use(compiled, ["points", "weights"]);
    this.bindValues(program, this.probeValues, 2);
    this.slotValues.begin(layers);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  private drawPixels(camera: RenderCamera, numbers: Tables, images: ImageTargets): void {
    const { gl } = this;
    const { width, height, hasAlpha } = images;
    const [half, direct] = [Math.tan(camera.yfov / 2), this.samples === 0];
    const [across, up] = [(half * width) / height, direct ? -half : half]; // encoded images have their top row first
    const [right, above, back] = [0, 1, 2].map((k) =>
      [0, 1, 2].map((row) => camera.to_world[4 * row + k] as number),
    ) as [number[], number[], number[]];
    const scaled = (axis: number[], factor: number) => axis.map((value) => value * factor);
    const features: ImageFeatures = { map: isMap(numbers), coverage: hasAlpha, direct };

    gl.bindFramebuffer(gl.FRAMEBUFFER, images.drawn);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    const [near, far] = [Math.max(camera.near, NEAR_PLANE * this.size), FAR_PLANE * this.size + camera.near];
    for (const faces of this.faces) {
      const program = this.useProgramFor(faces, features);
      this.setBackgroundUniforms(program, numbers);
      gl.uniform4f(
        program.uniform("uFrustum"),
        1 / across,
        1 / up,
        (far + near) / (near - far),
        (2 * far * near) / (near - far),
      );
      gl.uniformMatrix3fv(program.uniform("uRotation"), false, [...right, ...above, ...back]);
      gl.uniform3fv(program.uniform("uCameraPosition"), positionOf(camera));
      gl.uniform1f(program.uniform("uPixelAngle"), camera.yfov / height);
      gl.uniform3fv(program.uniform("uGain"), numbers.gain);
      this.setEnvironmentUniforms(program, numbers);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, faces.buffer);
      gl.drawElements(gl.TRIANGLES, faces.corners.length, gl.UNSIGNED_INT, 0);
    }

    const background = this.use(
      this.program({ background: features }, () => new Program(gl, FULLSCREEN_VERTEX, backgroundShader(features))),
      ["background"],
    );
    this.setBackgroundUniforms(background, numbers);
    gl.uniformMatrix3fv(background.uniform("uRays"), false, [
      ...scaled(right, across),
      ...scaled(above, up),
      ...scaled(back, -1),
    ]);
    gl.uniform2f(background.uniform("uSize"), width, height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.disable(gl.DEPTH_TEST);
  }

  /** The program for faces with the same features. */
  private useProgramFor({ shows }: FaceClass, imageFeatures: ImageFeatures): Program {
    const { gl, surface } = this;
    const features = { ...shows, ...imageFeatures };
    const compiled = this.program(
      { features },
      () => new Program(gl, cornerShader(shows), surfaceShader(surface, features)),
    );
    const program = this.use(compiled, [
      "corners",
      "sides",
      "facing",
      "normals",
      "points",
      "weights",
      "unoccluded",
      "materials",
      "lobes",
      "environment",
      "levels",
      "texels",
      "uvs",
      "background",
      "positions",
    ]);
    this.bindValues(program, this.slotValues, 15);
    return program;
  }

  private encodeRadiance(images: ImageTargets, radiance: WebGLTexture): void {
    const { gl } = this;
    const encodeProgram = this.program(
      { words: images.hasAlpha },
      () => new Program(gl, FULLSCREEN_VERTEX, encodeShader(images.hasAlpha)),
    );
    images.resolve();
    gl.useProgram(encodeProgram.handle);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, radiance);
    gl.uniform1i(encodeProgram.uniform("uImage"), 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, images.encoded);
    gl.viewport(0, 0, images.width, images.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** A program variant, compiled when first needed. */
  private program(features: object, make: () => Program): Program {
    const key = JSON.stringify(features);
    const existing = this.compiled.get(key) ?? make();
    this.compiled.set(key, existing);
    return existing;
  }

  private use(program: Program, arrays: readonly string[]): Program {
    this.gl.useProgram(program.handle);
    arrays.forEach((name, unit) => {
      this.gl.uniform1i(program.uniform(uniform(name)), unit);
      this.texels.bind(name, unit);
    });
    return program;
  }

  private bindValues(program: Program, values: ValueTarget, unit: number): void {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, values.texture);
    gl.uniform1i(program.uniform("uValues"), unit);
  }

  private setEnvironmentUniforms(program: Program, numbers: Tables): void {
    const { gl } = this;
    gl.uniform3fv(program.uniform("uEnvironmentGain"), numbers.environment_gain);
    gl.uniform3iv(program.uniform("uEnvironmentLevels"), numbers.environment_mips.slice(0, ENVIRONMENT_LEVELS).flat());
    gl.uniform1i(
      program.uniform("uNumEnvironmentLevels"),
      Math.min(ENVIRONMENT_LEVELS, numbers.environment_mips.length),
    );
    gl.uniform1f(program.uniform("uTurn"), numbers.environment_rotation);
    const brightLights = numbers.bright_lights.slice(0, MAX_BRIGHT_LIGHTS);
    gl.uniform1i(program.uniform("uNumBrightLights"), brightLights.length);
    if (brightLights.length === 0) return;
    gl.uniform4fv(
      program.uniform("uBrightLightDirections"),
      brightLights.flatMap(([x, y, z, , , , spread]) => [x, y, z, spread]),
    );
    gl.uniform3fv(
      program.uniform("uBrightLightRadiances"),
      brightLights.flatMap(([, , , ...light]) => light.slice(0, 3)),
    );
  }

  private setBackgroundUniforms(program: Program, numbers: Tables): void {
    const { gl } = this;
    gl.uniform3fv(program.uniform("uBackgroundGain"), numbers.background_gain);
    gl.uniform3fv(
      program.uniform("uBackgroundColor"),
      numbers.background === "color" ? numbers.background_color : [0, 0, 0],
    );
    gl.uniform1f(program.uniform("uTurn"), numbers.environment_rotation);
    gl.uniform1f(program.uniform("uFree"), numbers.shows_direct ? 1 : 0);
  }
}

const isMap = ({ background }: Tables): boolean => background === "map" || background === "blurred";

const positionOf = ({ to_world }: RenderCamera): [number, number, number] => [
  to_world[3] as number,
  to_world[7] as number,
  to_world[11] as number,
];

const encodedBytesOf = (bytes: Uint8Array): Uint32Array => new Uint32Array(bytes.slice().buffer);

/** Diagonal of the bounding box. */
function diagonalOf(positions: Uint8Array): number {
  const all = new Float32Array(positions.buffer, positions.byteOffset, positions.byteLength / 4);
  const [lowest, highest] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  for (let k = 0; k < all.length; k += 4) {
    for (let axis = 0; axis < 3; axis++) {
      lowest[axis] = Math.min(lowest[axis] as number, all[k + axis] as number);
      highest[axis] = Math.max(highest[axis] as number, all[k + axis] as number);
    }
  }
  return Math.max(1e-6, Math.hypot(...lowest.map((low, axis) => (highest[axis] as number) - low)));
}
