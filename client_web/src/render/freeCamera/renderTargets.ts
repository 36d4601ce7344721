/** Render targets of the free-camera passes. */
import { TEXELS_PER_ROW } from "./dataLayout";

type Gl = WebGL2RenderingContext;

export const LAYERS = 5;

function createFramebuffer(gl: Gl, make: () => number[]): WebGLFramebuffer {
  const buffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
  gl.drawBuffers(make());
  checkFramebuffer(gl);
  return buffer;
}

function checkFramebuffer(gl: Gl): void {
  if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE && !gl.isContextLost()) {
    throw new Error("This browser cannot render floating-point images");
  }
}

/** Twenty numbers per probe or lattice node: five layers of texels. */
export class ValueTarget {
  readonly texture: WebGLTexture;
  readonly rows: number;

  private readonly buffer: WebGLFramebuffer;
  private isInitialized = "";

  constructor(
    private readonly gl: Gl,
    count: number,
  ) {
    this.rows = Math.max(1, Math.ceil(count / TEXELS_PER_ROW));
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.texture);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA32F, TEXELS_PER_ROW, this.rows, LAYERS);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D_ARRAY, filter, gl.NEAREST);
    }
    this.buffer = gl.createFramebuffer();
  }

  /** Bind these layers for drawing, as consecutive outputs. */
  begin(layers: readonly number[]): void {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.buffer);
    gl.viewport(0, 0, TEXELS_PER_ROW, this.rows);
    if (layers.join() === this.isInitialized) return;
    this.isInitialized = layers.join();
    for (let k = 0; k < LAYERS; k++) {
      const texture = k < layers.length ? this.texture : null;
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + k, texture, 0, layers[k] ?? 0);
    }
    gl.drawBuffers(layers.map((_, k) => gl.COLOR_ATTACHMENT0 + k));
    checkFramebuffer(gl);
  }
}

function createImage(gl: Gl, format: number, width: number, height: number): WebGLTexture {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
    gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
  return texture;
}

/** Targets of one image size, encoded as RGB9_E5; with multisampling, radiance is drawn first. */
export class ImageTargets {
  /** Framebuffer of the surface pass, with depth. */
  readonly drawn: WebGLFramebuffer;
  readonly encoded: WebGLFramebuffer;
  /** The resolved radiance; null without multisampling. */
  readonly radiance: WebGLTexture | null = null;
  private readonly framebuffer: WebGLFramebuffer | null = null;
  private readonly made: { renderbuffers: WebGLRenderbuffer[]; textures: WebGLTexture[] } = {
    renderbuffers: [],
    textures: [],
  };

  constructor(
    private readonly gl: Gl,
    readonly width: number,
    readonly height: number,
    private readonly samples: number,
    /** Coverage is drawn too. */
    readonly hasAlpha: boolean,
  ) {
    const createEncoded = () =>
      this.textures(...Array.from({ length: hasAlpha ? 2 : 1 }, () => createImage(gl, gl.RGBA8, width, height)));
    if (samples === 0) {
      this.drawn = this.encoded = createFramebuffer(gl, () => {
        this.renderbuffer(gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24);
        return createEncoded();
      });
      return;
    }
    this.drawn = createFramebuffer(gl, () => {
      this.renderbuffer(gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24);
      this.renderbuffer(gl.COLOR_ATTACHMENT0, gl.RGBA16F);
      return [gl.COLOR_ATTACHMENT0];
    });
    const radiance = (this.radiance = createImage(gl, gl.RGBA16F, width, height));
    this.framebuffer = createFramebuffer(gl, () => this.textures(radiance));
    this.encoded = createFramebuffer(gl, createEncoded);
  }

  private renderbuffer(attachment: number, format: number): void {
    const { gl } = this;
    const buffer = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
    gl.renderbufferStorageMultisample(gl.RENDERBUFFER, this.samples, format, this.width, this.height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, attachment, gl.RENDERBUFFER, buffer);
    this.made.renderbuffers.push(buffer);
  }

  private textures(...textures: WebGLTexture[]): number[] {
    const { gl } = this;
    this.made.textures.push(...textures);
    return textures.map((texture, index) => {
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + index, gl.TEXTURE_2D, texture, 0);
      return gl.COLOR_ATTACHMENT0 + index;
    });
  }

  /** Resolve the multisampled radiance. */
  resolve(): void {
    const { gl, width, height } = this;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.drawn);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.framebuffer);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
  }

  dispose(): void {
    for (const buffer of [this.drawn, this.framebuffer, this.encoded]) this.gl.deleteFramebuffer(buffer);
    for (const buffer of this.made.renderbuffers) this.gl.deleteRenderbuffer(buffer);
    for (const texture of this.made.textures) this.gl.deleteTexture(texture);
  }
}
