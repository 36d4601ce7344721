/** A file and its name with the folders that it was dropped in. */
export interface DroppedFile {
  path: string;
  file: File;
}
