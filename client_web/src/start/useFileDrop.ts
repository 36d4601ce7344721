/** Files and folders dropped anywhere on the page; whether some are held over it. */
import { useLayoutEffect, useState } from "preact/hooks";
import type { Dropped } from "../files/dropped";
import { droppedFiles } from "../files/folders";
import { attempt } from "../ui/toasts";

export function useFileDrop(take: (files: Dropped[]) => void): boolean {
  const [over, setOver] = useState(false);
  // with the page itself: what is dropped as soon as it is seen is taken
  useLayoutEffect(() => {
    const drag = (event: DragEvent) => {
      if (!event.dataTransfer?.types.includes("Files")) return;
      event.preventDefault(); // else the browser would open the file in place of the page
      // from one element to the next is no way out of the page
      if (event.type === "dragover" || event.relatedTarget === null) setOver(event.type === "dragover");
    };
    const drop = (event: DragEvent) => {
      const transfer = event.dataTransfer;
      if (!transfer?.types.includes("Files")) return;
      event.preventDefault();
      setOver(false);
      void attempt(async () => take(await droppedFiles(transfer)));
    };
    window.addEventListener("dragover", drag);
    window.addEventListener("dragleave", drag);
    window.addEventListener("drop", drop);
    return () => {
      window.removeEventListener("dragover", drag);
      window.removeEventListener("dragleave", drag);
      window.removeEventListener("drop", drop);
    };
  });
  return over;
}
