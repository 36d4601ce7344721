/** Contrast of the display, as the server computes it (`relume.image_io.contrast`). */

export const MIDDLE_GRAY = 0.18;

/** Radiance, not negative, with another slope of its logarithm about middle gray. */
export const withContrast = (radiance: number, contrast: number): number =>
  MIDDLE_GRAY * (radiance / MIDDLE_GRAY) ** contrast;
