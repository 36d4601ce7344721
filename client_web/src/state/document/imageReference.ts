/** References of terms to textures and roughness maps. */
const IMAGE_PREFIX = "image:";

/** True if a reference is an uploaded image, not one of the material's own maps. */
export const isImageReference = (texture: string | boolean | null | undefined): texture is string =>
  typeof texture === "string" && texture.startsWith(IMAGE_PREFIX);
