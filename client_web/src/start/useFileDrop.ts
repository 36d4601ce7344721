/** Handles files and folders dropped anywhere on the page; returns true while some are dragged over it. */
import { useLayoutEffect, useState } from "preact/hooks";
import type { DroppedFile } from "./files/dropTypes";
import { listDroppedFiles } from "./files/dropFolders";
import { reportErrors } from "../ui/toasts";

export function useFileDrop(onFiles: (files: DroppedFile[]) => void): boolean {
  const [isDropTarget, setDropTarget] = useState(false);
  // installed with the page, so that an early drop is not lost
  useLayoutEffect(() => {
    const onDrag = (event: DragEvent) => {
      if (!event.dataTransfer?.types.includes("Files")) return;
      event.preventDefault(); // otherwise the browser would open the file
      // moving between elements does not leave the page
      if (event.type === "dragover" || event.relatedTarget === null) setDropTarget(event.type === "dragover");
    };
    const onDrop = (event: DragEvent) => {
      const transfer = event.dataTransfer;
      if (!transfer?.types.includes("Files")) return;
      event.preventDefault();
      setDropTarget(false);
      void reportErrors(async () => onFiles(await listDroppedFiles(transfer)));
    };
    window.addEventListener("dragover", onDrag);
    window.addEventListener("dragleave", onDrag);
    window.addEventListener("drop", onDrop);
    return () => {
      window.removeEventListener("dragover", onDrag);
      window.removeEventListener("dragleave", onDrag);
      window.removeEventListener("drop", onDrop);
    };
  });
  return isDropTarget;
}
