/** What terms of a look name as their texture, or as their map of roughness. */
const IMAGE_PREFIX = "image:";

/** Whether that is an image that a look names, none of the material's own. */
export const isImageReference = (texture: string | boolean | null | undefined): texture is string =>
  typeof texture === "string" && texture.startsWith(IMAGE_PREFIX);
