/** What terms of a look name as their texture, or as their map of roughness. */
const PREFIX = "image:";

/** Whether that is an image that a look names, none of the material's own. */
export const isImage = (texture: string | boolean | null | undefined): texture is string =>
  typeof texture === "string" && texture.startsWith(PREFIX);
