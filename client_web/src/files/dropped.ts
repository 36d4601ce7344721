/** A file and its name with the folders that it was dropped in. */
export interface Dropped {
  path: string;
  file: File;
}
