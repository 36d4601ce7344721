/** Files of what was dropped, folders and the folders in them included. */
import type { DroppedFile } from "./dropTypes";

const MAX_FILES = 3000;
const MAX_DEPTH = 12;

class TooManyFilesError extends Error {
  constructor() {
    super(`The folder holds more than ${MAX_FILES.toLocaleString("en")} files, or folders ${MAX_DEPTH} deep; drop only the scene's.`);
  }
}

const isHidden = (entry: FileSystemEntry) => entry.name.startsWith(".") || entry.name === "__MACOSX";

function readFile(entry: FileSystemFileEntry): Promise<File> {
  return new Promise((resolve, reject) => entry.file(resolve, reject));
}

/** A folder's entries; a reader gives a hundred at a time, and then none. */
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
    for (const inner of await readEntries(entry as FileSystemDirectoryEntry)) await collectFiles(inner, into, depth + 1);
}

/** What a drop brought. Call it in the event itself: its entries are gone afterwards. */
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
