/** Color space and range of the canvases, as far as browser and screen have them. */

/** Standard range in sRGB or Display P3, or high dynamic range: sRGB beyond [0, 1] ("extended"). */
export type CanvasColor = "srgb" | "display-p3" | "hdr";

export interface CanvasAbilities {
  /** The browser has canvases in Display P3; the screen shows it. */
  hasP3: boolean;
  isWideGamut: boolean;
  /** The browser has canvases beyond paper white; the screen shows it. */
  hasHdr: boolean;
  isHighRange: boolean;
}

/** Members of WebGL2 contexts that not all browsers have. */
export interface ColorContext {
  drawingBufferColorSpace?: string;
  drawingBufferStorage?: (format: number, width: number, height: number) => void;
  drawingBufferToneMapping?: (toneMapping: { mode: "standard" | "extended" }) => void;
}

export const WIDE_GAMUT_QUERY = "(color-gamut: p3)";
export const HIGH_RANGE_QUERY = "(dynamic-range: high)";

/** Members that contexts of this browser have; empty without WebGL2. */
export const contextPrototype: object = "WebGL2RenderingContext" in globalThis ? WebGL2RenderingContext.prototype : {};

/** True if canvases of a browser can go beyond paper white. context: a WebGL2 context, or the prototype. */
export const hasHdrCanvas = (context: object): boolean =>
  "drawingBufferStorage" in context && "drawingBufferToneMapping" in context;

/** The abilities of a browser and its screen. matches: evaluates a media query. */
export const readAbilities = (context: object, matches: (query: string) => boolean): CanvasAbilities => ({
  hasP3: "drawingBufferColorSpace" in context,
  isWideGamut: matches(WIDE_GAMUT_QUERY),
  hasHdr: hasHdrCanvas(context),
  isHighRange: matches(HIGH_RANGE_QUERY),
});

/** Why a choice is not available; null if it is. */
export function whyUnavailable(color: CanvasColor, abilities: CanvasAbilities): string | null {
  if (color === "display-p3") {
    if (!abilities.hasP3) return "Display P3 needs a newer browser.";
    return abilities.isWideGamut ? null : "Display P3 needs a wide-gamut screen.";
  }
  if (color === "hdr") {
    if (!abilities.hasHdr) return "HDR needs a browser with HDR canvases.";
    return abilities.isHighRange ? null : "HDR needs an HDR screen; turn HDR on in the system settings.";
  }
  return null;
}

/** The choice if it is available, else sRGB. */
export const availableColor = (choice: CanvasColor, abilities: CanvasAbilities): CanvasColor =>
  whyUnavailable(choice, abilities) === null ? choice : "srgb";

/** Set color space and range of the drawing buffer, which is cleared. */
export function configureCanvas(gl: WebGL2RenderingContext, color: CanvasColor, width: number, height: number): void {
  const context = gl as ColorContext;
  if ("drawingBufferColorSpace" in gl) context.drawingBufferColorSpace = color === "display-p3" ? "display-p3" : "srgb";
  if (!hasHdrCanvas(gl)) return;
  gl.getExtension("EXT_color_buffer_float");
  gl.getExtension("EXT_color_buffer_half_float");
  context.drawingBufferStorage?.(color === "hdr" ? gl.RGBA16F : gl.RGBA8, width, height);
  context.drawingBufferToneMapping?.({ mode: color === "hdr" ? "extended" : "standard" });
}
