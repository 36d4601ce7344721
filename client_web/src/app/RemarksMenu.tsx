/** A mark by the scene's name where its import had something to say, and the list of it. */
import { useState } from "preact/hooks";
import { countsOf, Remarks } from "../start/Remarks";
import { scene } from "../state/scene";

export function RemarksMenu() {
  const [open, setOpen] = useState(false);
  const remarks = scene.value?.remarks ?? [];
  if (remarks.length === 0) return null;
  const label = `What the import says: ${countsOf(remarks)}`;
  return (
    <div class="menu" onKeyDown={(event) => event.key === "Escape" && setOpen(false)}>
      <button
        class={remarks.some(({ effect }) => effect === "wrong") ? "remark-mark is-wrong" : "remark-mark"}
        aria-expanded={open}
        aria-label={label}
        title={label}
        onClick={() => setOpen(!open)}
      >
        ! {remarks.length}
      </button>
      {open && (
        <div class="menu-body remarks-menu">
          <Remarks remarks={remarks} />
        </div>
      )}
    </div>
  );
}
