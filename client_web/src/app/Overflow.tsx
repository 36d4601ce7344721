/** A row of controls; those that it has no room for are in a menu at its end. */
import type { ComponentType } from "preact";
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { IconButton } from "../ui/Button";
import { useClosing } from "../ui/useClosing";
import { leaving } from "./rowRoom";

interface Control {
  name: string;
  rank: number;
  Content: ComponentType;
}

const GAP = 8;
const BUTTON = 26;

/** The names of the controls that have no room, measured anew whenever the row or one of them has another size. */
function useLeaving(controls: readonly Control[]) {
  const row = useRef<HTMLDivElement>(null);
  const widths = useRef(new Map<string, number>());
  const [out, setOut] = useState<readonly string[]>([]);
  useLayoutEffect(() => {
    const element = row.current as HTMLDivElement;
    const placed = [...element.children].filter((child) => child instanceof HTMLElement && child.dataset.control);
    const measure = () => {
      for (const child of placed as HTMLElement[]) widths.current.set(child.dataset.control as string, child.offsetWidth);
      const parts = controls.map(({ name, rank }) => ({ name, rank, width: widths.current.get(name) ?? 0 }));
      const next = leaving(parts, element.clientWidth, GAP, BUTTON);
      setOut((before) => (before.join() === next.join() ? before : next));
    };
    const observer = new ResizeObserver(measure);
    measure();
    for (const each of [element, ...placed]) observer.observe(each);
    return () => observer.disconnect();
  });
  return { row, out };
}

export function Overflow({ controls }: { controls: readonly Control[] }) {
  const { row, out } = useLeaving(controls);
  const [wanted, setWanted] = useState(false);
  const menu = useRef<HTMLDivElement>(null);
  const open = wanted && out.length > 0;
  useClosing(open, menu, () => setWanted(false));
  return (
    <div class="overflow" ref={row}>
      {controls.map(
        ({ name, Content }) =>
          !out.includes(name) && (
            <div key={name} class={`control ${name}`} data-control={name}>
              <Content />
            </div>
          ),
      )}
      {out.length > 0 && (
        <div class="more" ref={menu} onKeyDown={(event) => event.key === "Escape" && setWanted(false)}>
          <IconButton icon="more" label="More" expanded={open} onClick={() => setWanted(!wanted)} />
          {open && (
            <div class="more-body">
              {controls.map(
                ({ name, Content }) =>
                  out.includes(name) && (
                    <div key={name} class={`control ${name}`}>
                      <Content />
                    </div>
                  ),
              )}
            </div>
          )}
        </div>
      )}
    </div>
  );
}
