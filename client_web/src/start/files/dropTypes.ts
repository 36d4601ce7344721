/** A file and its path within the dropped folders. */
export interface DroppedFile {
  path: string;
  file: File;
}
