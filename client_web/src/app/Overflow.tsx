/** A row of controls; those that do not fit are in a menu at its end. */
import type { ComponentType } from "preact";
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { IconButton } from "../ui/IconButton";
import { useDismiss } from "../ui/useDismiss";
import { overflowingItems } from "./rowFit";

interface OverflowControl {
  name: string;
  rank: number;
  Content: ComponentType;
}

const GAP = 8;
const BUTTON_WIDTH = 26;

/** Names of the controls that do not fit, measured again when the row or a control changes size. */
function useOverflow(controls: readonly OverflowControl[]) {
  const row = useRef<HTMLDivElement>(null);
  const widths = useRef(new Map<string, number>());
  const [out, setOut] = useState<readonly string[]>([]);
  useLayoutEffect(() => {
    const element = row.current as HTMLDivElement;
    const controlElements = [...element.children].filter(
      (child) => child instanceof HTMLElement && child.dataset.control,
    );
    const measure = () => {
      for (const child of controlElements as HTMLElement[])
        widths.current.set(child.dataset.control as string, child.offsetWidth);
      const rowItems = controls.map(({ name, rank }) => ({ name, rank, width: widths.current.get(name) ?? 0 }));
      const next = overflowingItems(rowItems, element.clientWidth, GAP, BUTTON_WIDTH);
      setOut((previous) => (previous.join() === next.join() ? previous : next));
    };
    const observer = new ResizeObserver(measure);
    measure();
    for (const each of [element, ...controlElements]) observer.observe(each);
    return () => observer.disconnect();
  });
  return { row, out };
}

export function Overflow({ controls }: { controls: readonly OverflowControl[] }) {
  const { row, out } = useOverflow(controls);
  const [isMenuRequested, setMenuRequested] = useState(false);
  const menu = useRef<HTMLDivElement>(null);
  const open = isMenuRequested && out.length > 0;
  useDismiss(open, menu, () => setMenuRequested(false));
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
        <div class="more" ref={menu} onKeyDown={(event) => event.key === "Escape" && setMenuRequested(false)}>
          <IconButton icon="more" label="More" expanded={open} onClick={() => setMenuRequested(!isMenuRequested)} />
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
