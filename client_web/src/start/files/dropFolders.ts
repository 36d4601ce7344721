/** The files of a drop, including nested folders. */
import type { DroppedFile } from "./dropTypes";

const MAX_FILES = 3000;
const MAX_DEPTH = 12;

class TooManyFilesError extends Error {
  constructor() {
    super(
      `This folder has more than ${MAX_FILES.toLocaleString("en")} files or ${MAX_DEPTH} levels. Drop only the scene's folder.`,
    );
  }
}

const isHidden = (entry: FileSystemEntry) => entry.name.startsWith(".") || entry.name === "__MACOSX";

function readFile(entry: FileSystemFileEntry): Promise<File> {
  return new Promise((resolve, reject) => entry.file(resolve, reject));
}

/** A folder's entries; the reader returns them in batches, and an empty one at the end. */
async function readEntries(folder: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
  const reader = folder.createReader();
  const entries: FileSystemEntry[] = [];
  for (;;) {
    const batch = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (batch.length === 0) return entries;
    entries.push(...batch);
    if (entries.length > MAX_FILES) throw new TooManyFilesError();
  }
}

async function collectFiles(entry: FileSystemEntry, into: DroppedFile[], depth: number): Promise<void> {
  if (depth > MAX_DEPTH || into.length > MAX_FILES) throw new TooManyFilesError();
  if (isHidden(entry)) return;
  if (entry.isFile)
    into.push({ path: entry.fullPath.replace(/^\//, ""), file: await readFile(entry as FileSystemFileEntry) });
  else
    for (const inner of await readEntries(entry as FileSystemDirectoryEntry))
      await collectFiles(inner, into, depth + 1);
}

/** The dropped files. Call it inside the event handler: the entries are invalid afterwards. */
export async function listDroppedFiles(transfer: DataTransfer): Promise<DroppedFile[]> {
  const items = [...transfer.items].filter((item) => item.kind === "file");
  const entries = items.map((item) => item.webkitGetAsEntry() ?? item.getAsFile());
  const files: DroppedFile[] = [];
  for (const each of entries) {
    if (each instanceof File) files.push({ path: each.name, file: each });
    else if (each !== null) await collectFiles(each, files, 0);
  }
  return files;
}
