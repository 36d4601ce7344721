/** Files of what was dropped, folders and the folders in them included. */
import type { Dropped } from "./dropped";

const MAX_FILES = 3000;
const MAX_DEPTH = 12;

class TooManyError extends Error {
  constructor() {
    super(`The folder holds more than ${MAX_FILES.toLocaleString("en")} files, or folders ${MAX_DEPTH} deep; drop only the scene's.`);
  }
}

const isHidden = (entry: FileSystemEntry) => entry.name.startsWith(".") || entry.name === "__MACOSX";

function fileOf(entry: FileSystemFileEntry): Promise<File> {
  return new Promise((resolve, reject) => entry.file(resolve, reject));
}

/** A folder's entries; a reader gives a hundred at a time, and then none. */
async function entriesOf(folder: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
  const reader = folder.createReader();
  const entries: FileSystemEntry[] = [];
  for (;;) {
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) return entries;
    entries.push(...some);
    if (entries.length > MAX_FILES) throw new TooManyError();
  }
}

async function collect(entry: FileSystemEntry, into: Dropped[], depth: number): Promise<void> {
  if (depth > MAX_DEPTH || into.length > MAX_FILES) throw new TooManyError();
  if (isHidden(entry)) return;
  if (entry.isFile)
    into.push({ path: entry.fullPath.replace(/^\//, ""), file: await fileOf(entry as FileSystemFileEntry) });
  else
    for (const inner of await entriesOf(entry as FileSystemDirectoryEntry)) await collect(inner, into, depth + 1);
}

/** What a drop brought. Call it in the event itself: its entries are gone afterwards. */
export async function droppedFiles(transfer: DataTransfer): Promise<Dropped[]> {
  const items = [...transfer.items].filter((item) => item.kind === "file");
  const taken = items.map((item) => item.webkitGetAsEntry() ?? item.getAsFile());
  const files: Dropped[] = [];
  for (const each of taken) {
    if (each instanceof File) files.push({ path: each.name, file: each });
    else if (each !== null) await collect(each, files, 0);
  }
  return files;
}
