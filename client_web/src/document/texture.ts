/** What terms of a look name as their texture. */
const PREFIX = "image:";

/** Whether a term's texture is an image that a look names, none of the material's own. */
export const isImage = (texture: string | null | undefined): texture is string => texture?.startsWith(PREFIX) === true;
