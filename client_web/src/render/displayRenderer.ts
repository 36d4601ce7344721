/** WebGL2 rendering of the image. All its data is also on the CPU, so a lost context only costs a redraw. */
import { configureCanvas, contextPrototype, hasHdrCanvas, type CanvasColor } from "./color/canvasColor";
import { lutSize, type LutTable } from "./color/lutTable";
import type { DifferenceMode } from "./color/difference";
import type { DisplayTransform } from "./color/tonemap";
import type { Tile } from "../protocol";
import { allocate, makeTexture, makeVolume, Program } from "./webgl";
import type { PixelBuffer } from "./pixels";
import { fragmentShader, VERTEX, type DisplayFeatures } from "./displayShaders";

const UNITS = ["uImage", "uReference", "uDisplay", "uBrush", "uAlpha", "uReferenceAlpha", "uIds"] as const;
const VOLUMES = ["uTable", "uLut"] as const;
type TextureUnit = (typeof UNITS)[number];
/** Screen pixels per image pixel from which on pixels are drawn without filtering. */
const NEAREST_FROM = 6;

export interface DisplayState {
  /** Left, top, width, height of the image in device pixels. */
  transform: [number, number, number, number];
  display: DisplayTransform;
  falseColor: boolean;
  wipe: number;
  difference: DifferenceMode;
  hover: number;
  /** Id of the solo material, -1 for none. */
  solo: number;
  brush: boolean;
  displayReferred: boolean;
  transparent: boolean;
  transparentReference: boolean;
  surround: [number, number, number];
  canvasColor: CanvasColor;
}

export class DisplayRenderer {
  private readonly gl: WebGL2RenderingContext;
  private programs = new Map<string, Program>();
  private textures!: Record<TextureUnit, WebGLTexture>;
  private size: [number, number] = [1, 1];
  /** Color and size that the drawing buffer is configured for. */
  private configured = "";
  /** The tables of the view and of the display LUT, and their textures. */
  private volumes!: { texture: WebGLTexture; table: LutTable | null }[];

  constructor(readonly canvas: HTMLCanvasElement) {
    // drawing buffers of another format must have alpha
    const alpha = hasHdrCanvas(contextPrototype);
    const gl = canvas.getContext("webgl2", { alpha, antialias: false, depth: false });
    if (gl === null)
      throw new Error(
        "This browser has no WebGL2, which the editor needs. Turn on hardware acceleration or use another browser.",
      );
    this.gl = gl;
    this.restore();
  }

  /** Create all GPU resources, at the start and after a lost context. */
  restore(): void {
    const { gl } = this;
    this.programs.clear();
    this.configured = "";
    this.textures = Object.fromEntries(
      UNITS.map((unit) => [unit, makeTexture(gl, unit === "uIds" ? gl.NEAREST : gl.LINEAR)]),
    ) as Record<TextureUnit, WebGLTexture>;
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    for (const unit of ["uImage", "uReference"] as const) allocate(gl, this.textures[unit], 1, 1, new Uint32Array(1));
    this.setBrush(1, 1, new Uint8Array(1));
    this.setAlpha(1, 1, new Uint8Array(1));
    this.setReferenceAlpha(1, 1, new Uint8Array(1));
    this.setIds(1, 1, new Uint16Array([65535]));
    this.setDisplay(new ImageData(1, 1));
    this.volumes = VOLUMES.map(() => ({ texture: makeVolume(gl), table: null }));
  }

  /** Release the context: browsers limit their number. */
  release(): void {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  private use(features: DisplayFeatures): Program {
    const key = JSON.stringify(features);
    let program = this.programs.get(key);
    if (program === undefined) {
      program = new Program(this.gl, VERTEX, fragmentShader(features));
      this.programs.set(key, program);
      this.gl.useProgram(program.handle);
      [...UNITS, ...VOLUMES].forEach((unit, index) => this.gl.uniform1i(program?.uniform(unit) ?? null, index));
    } else this.gl.useProgram(program.handle);
    return program;
  }

  setImage(pixels: PixelBuffer): void {
    this.size = [pixels.width, pixels.height];
    allocate(this.gl, this.textures.uImage, pixels.width, pixels.height, pixels.encoded);
  }

  /** Upload all pixels of the image again. */
  updateImage(pixels: PixelBuffer): void {
    this.uploadTiles([{ tile: [0, 0, pixels.width, pixels.height], encoded: pixels.encoded }]);
  }

  setReference(pixels: PixelBuffer): void {
    allocate(this.gl, this.textures.uReference, pixels.width, pixels.height, pixels.encoded);
  }

  uploadTiles(tiles: { tile: Tile; encoded: Uint32Array }[]): void {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.textures.uImage);
    for (const { tile, encoded } of tiles) {
      const [x, y, w, h] = tile;
      gl.texSubImage2D(gl.TEXTURE_2D, 0, x, y, w, h, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV, encoded);
    }
  }

  setDisplay(image: TexImageSource): void {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.textures.uDisplay);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
  }

  setBrush(width: number, height: number, values: Uint8Array): void {
    this.setBytes("uBrush", width, height, values);
  }

  setAlpha(width: number, height: number, values: Uint8Array): void {
    this.setBytes("uAlpha", width, height, values);
  }

  setReferenceAlpha(width: number, height: number, values: Uint8Array): void {
    this.setBytes("uReferenceAlpha", width, height, values);
  }

  private setBytes(unit: TextureUnit, width: number, height: number, values: Uint8Array): void {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.textures[unit]);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, width, height, 0, gl.RED, gl.UNSIGNED_BYTE, values);
  }

  setIds(width: number, height: number, ids: Uint16Array): void {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.textures.uIds);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R16UI, width, height, 0, gl.RED_INTEGER, gl.UNSIGNED_SHORT, ids);
  }

  draw(state: DisplayState): void {
    const { gl, canvas } = this;
    if (gl.isContextLost()) return;
    this.configure(state.canvasColor);
    gl.viewport(0, 0, canvas.width, canvas.height);
    const { matrix, contrast, toneMap, lut } = state.display;
    const program = this.use({
      toneMap: typeof toneMap === "string" ? toneMap : "table",
      contrast: contrast !== 1,
      lut: lut !== null,
      falseColor: state.falseColor,
      isMinified: state.transform[2] < this.size[0],
      displayReferred: state.displayReferred,
      transparent: state.transparent,
      compare: state.wipe > 0 || state.difference !== "off",
      difference: state.difference,
      transparentReference: state.wipe > 0 && state.transparentReference,
      brush: state.brush,
      outline: state.hover >= 0,
      solo: state.solo >= 0,
      canvasColor: state.canvasColor,
    });
    this.bindTextures(state.transform[2] / this.size[0] >= NEAREST_FROM);
    this.bindVolume(0, typeof toneMap === "string" ? null : toneMap);
    this.bindVolume(1, lut);
    gl.uniform2f(program.uniform("uCanvas"), canvas.width, canvas.height);
    gl.uniform4f(program.uniform("uImageRect"), ...state.transform);
    gl.uniform2f(program.uniform("uSize"), ...this.size);
    gl.uniformMatrix3fv(program.uniform("uDisplayMatrix"), true, matrix.flat());
    gl.uniform1f(program.uniform("uContrast"), contrast);
    gl.uniform1f(program.uniform("uWipe"), state.wipe);
    gl.uniform1i(program.uniform("uHover"), state.hover);
    gl.uniform1i(program.uniform("uSolo"), state.solo);
    gl.uniform3f(program.uniform("uSurround"), ...state.surround);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** A resized canvas has a new drawing buffer. */
  private configure(color: CanvasColor): void {
    const { width, height } = this.canvas;
    const configuration = `${color} ${width} ${height}`;
    if (configuration !== this.configured) configureCanvas(this.gl, color, width, height);
    this.configured = configuration;
  }

  private bindVolume(index: number, table: LutTable | null): void {
    const { gl } = this;
    const volume = this.volumes[index];
    if (table === null || volume === undefined) return;
    gl.activeTexture(gl.TEXTURE0 + UNITS.length + index);
    gl.bindTexture(gl.TEXTURE_3D, volume.texture);
    if (table === volume.table) return;
    const size = lutSize(table);
    gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGB16F, size, size, size, 0, gl.RGB, gl.FLOAT, table);
    volume.table = table;
  }

  private bindTextures(magnified: boolean): void {
    const { gl } = this;
    UNITS.forEach((unit, index) => {
      gl.activeTexture(gl.TEXTURE0 + index);
      gl.bindTexture(gl.TEXTURE_2D, this.textures[unit]);
      if (unit === "uImage" || unit === "uReference" || unit === "uAlpha" || unit === "uReferenceAlpha") {
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, magnified ? gl.NEAREST : gl.LINEAR);
      }
    });
  }
}
