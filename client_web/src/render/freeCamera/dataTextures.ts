/** Arrays of texels on the GPU, in rows of `TEXELS_PER_ROW`. */
import { TEXELS_PER_ROW } from "./dataLayout";

type Gl = WebGL2RenderingContext;
export type TexelType = "float32" | "float16" | "uint32" | "int32" | "rgb9e5";

/** Number type of a texel. */
export const BYTES_PER_TEXEL: Record<TexelType, number> = { float32: 4, float16: 2, uint32: 4, int32: 4, rgb9e5: 4 };

/** Internal format, format and type of texels, by number of components. */
function formatOf(gl: Gl, kind: TexelType, numbers: number): [number, number, number] {
  if (kind === "rgb9e5") return [gl.RGB9_E5, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV];
  const formatIndex = numbers === 1 ? 0 : numbers === 2 ? 1 : 2;
  const float = [gl.RED, gl.RG, gl.RGBA][formatIndex] as number;
  const integer = [gl.RED_INTEGER, gl.RG_INTEGER, gl.RGBA_INTEGER][formatIndex] as number;
  const internal = {
    float32: [gl.R32F, gl.RG32F, gl.RGBA32F],
    float16: [gl.R16F, gl.RG16F, gl.RGBA16F],
    uint32: [gl.R32UI, gl.RG32UI, gl.RGBA32UI],
    int32: [gl.R32I, gl.RG32I, gl.RGBA32I],
  }[kind][formatIndex] as number;
  const type = { float32: gl.FLOAT, float16: gl.HALF_FLOAT, uint32: gl.UNSIGNED_INT, int32: gl.INT }[kind];
  return [internal, kind === "uint32" || kind === "int32" ? integer : float, type];
}

function viewOf(kind: TexelType, bytes: Uint8Array): ArrayBufferView {
  const alignedBytes = bytes.byteOffset % 4 === 0 ? bytes : bytes.slice();
  const count = alignedBytes.byteLength / BYTES_PER_TEXEL[kind];
  if (kind === "float32") return new Float32Array(alignedBytes.buffer, alignedBytes.byteOffset, count);
  if (kind === "float16") return new Uint16Array(alignedBytes.buffer, alignedBytes.byteOffset, count);
  if (kind === "int32") return new Int32Array(alignedBytes.buffer, alignedBytes.byteOffset, count);
  return new Uint32Array(alignedBytes.buffer, alignedBytes.byteOffset, count);
}

export class DataTextures {
  private readonly textures = new Map<string, WebGLTexture>();
  private readonly counts = new Map<string, number>();

  constructor(private readonly gl: Gl) {}

  /** Number of texels of an array. */
  count(name: string): number {
    return this.counts.get(name) ?? 0;
  }

  /** Upload an array. Throws if it is too large. */
  upload(name: string, kind: TexelType, numbers: number, bytes: Uint8Array): void {
    const { gl } = this;
    const [internal, format, type] = formatOf(gl, kind, numbers);
    const count = bytes.byteLength / (BYTES_PER_TEXEL[kind] * numbers);
    const height = Math.max(1, Math.ceil(count / TEXELS_PER_ROW));
    if (height > (gl.getParameter(gl.MAX_TEXTURE_SIZE) as number))
      throw new Error(`The array “${name}” is too large for this browser's textures`);
    gl.bindTexture(gl.TEXTURE_2D, this.textureNamed(name));
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, TEXELS_PER_ROW, height, 0, format, type, null);
    const [view, fullRows] = [viewOf(kind, bytes), Math.floor(count / TEXELS_PER_ROW)];
    if (fullRows > 0) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, TEXELS_PER_ROW, fullRows, format, type, view, 0);
    const remainder = count - fullRows * TEXELS_PER_ROW;
    if (remainder > 0)
      gl.texSubImage2D(
        gl.TEXTURE_2D,
        0,
        0,
        fullRows,
        remainder,
        1,
        format,
        type,
        view,
        fullRows * TEXELS_PER_ROW * numbers,
      );
    this.counts.set(name, count);
  }

  /** Upload a radiance map, periodic in u, with bilinear filtering. */
  uploadMap(name: string, width: number, height: number, encoded: Uint8Array): void {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.textureNamed(name));
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, filter, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.REPEAT);
    const view = viewOf("rgb9e5", encoded.subarray(0, 4 * width * height));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB9_E5, width, height, 0, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV, view);
  }

  /** Bind an array to a unit; a missing one reads as zero. */
  bind(name: string, unit: number, target: number = this.gl.TEXTURE_2D): void {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(target, this.textures.get(name) ?? null);
  }

  private textureNamed(name: string): WebGLTexture {
    const { gl } = this;
    const existing = this.textures.get(name);
    if (existing !== undefined) return existing;
    const texture = gl.createTexture();
    this.textures.set(name, texture);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
    for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, wrap, gl.CLAMP_TO_EDGE);
    return texture;
  }
}
