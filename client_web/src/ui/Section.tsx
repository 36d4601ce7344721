/** A collapsible section of a panel. */
import type { ComponentChildren } from "preact";
import { foldedSections, toggleFolded } from "../state/panels";

interface Props {
  title: string;
  /** Count shown beside the title. */
  count?: number;
  /** Buttons beside the title, also visible when collapsed. */
  actions?: ComponentChildren;
  children: ComponentChildren;
}

export function Section({ title, count, actions, children }: Props) {
  const open = !foldedSections.value.includes(title);
  return (
    <section aria-label={title}>
      <header class="panel-head">
        <h2 class="spacer">
          <button class="fold" aria-expanded={open} onClick={() => toggleFolded(title)}>
            <span aria-hidden="true">{open ? "▾" : "▸"}</span> {title}
            {count !== undefined && count > 0 && <span class="count">{count}</span>}
          </button>
        </h2>
        {actions}
      </header>
      {open && children}
    </section>
  );
}
