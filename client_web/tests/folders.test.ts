/** The folders of the editor import each other in one direction. */
import { readdirSync, readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { expect, test } from "vitest";

const ROOT = join(import.meta.dirname, "../src");
const IMPORT = /(?:from|import)\s*\(?\s*"(\.[^"]+)"/g;

const files = readdirSync(ROOT, { recursive: true, encoding: "utf-8" }).filter((name) => /\.tsx?$/.test(name));

/** Of each folder the folders that its files import from. */
function importsOf(sources: readonly (readonly [file: string, text: string])[]): Map<string, Set<string>> {
  const imports = new Map<string, Set<string>>();
  for (const [file, text] of sources) {
    const folder = dirname(file);
    const importedFolders = imports.get(folder) ?? new Set<string>();
    imports.set(folder, importedFolders);
    for (const [, path] of text.matchAll(IMPORT)) {
      const importedFolder = dirname(join(folder, path as string));
      if (importedFolder !== folder) importedFolders.add(importedFolder);
    }
  }
  return imports;
}

/** Folders that lie on a circle, or lead to one: what is left when those that import nothing are taken away in turn. */
function circles(imports: ReadonlyMap<string, ReadonlySet<string>>): string[] {
  const left = new Map(imports);
  for (;;) {
    const free = [...left.keys()].filter((folder) =>
      [...(left.get(folder) ?? [])].every((importedFolder) => !left.has(importedFolder)),
    );
    if (free.length === 0)
      return [...left].map(
        ([folder, importedFolders]) => `${folder} → ${[...importedFolders].filter((o) => left.has(o)).join(", ")}`,
      );
    for (const folder of free) left.delete(folder);
  }
}

test("a circle between folders is found", () => {
  const sources = [
    ["a/x.ts", 'import { y } from "../b/y";'],
    ["b/y.ts", 'import type { X } from "../a/x";'],
    ["c/z.ts", ""],
  ] as const;
  expect(circles(importsOf(sources))).toEqual(["a → b", "b → a"]);
});

test("folders import each other in one direction", () => {
  const sources = files.map((file) => [file, readFileSync(join(ROOT, file), "utf-8")] as const);
  expect(circles(importsOf(sources))).toEqual([]);
});
