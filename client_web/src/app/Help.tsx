/** The list of keyboard shortcuts, over a corner of the image; Escape or ? closes it. */
import { useEffect, useRef } from "preact/hooks";
import { helpOpen } from "../state/panels";
import { IconButton } from "../ui/IconButton";
import { keyName } from "../ui/chord";
import { useReturnFocus } from "../ui/restoreFocus";
import { SHORTCUTS, FOCUS_KEYS } from "./shortcuts";

const GROUPS = ["Picture", "Camera", "Look", "Compare", "Curve", "Panels"] as const;

export function Help() {
  const panel = useRef<HTMLDivElement>(null);
  useReturnFocus(panel, true);
  useEffect(() => panel.current?.focus(), []);
  return (
    <div class="help" ref={panel} tabIndex={-1} role="dialog" aria-label="Keyboard shortcuts">
      <header class="panel-head">
        <h2>Keyboard shortcuts</h2>
        <IconButton icon="close" label="Close" keys="Esc" onClick={() => (helpOpen.value = false)} />
      </header>
      <div class="help-groups">
        {GROUPS.map((group) => (
          <dl key={group}>
            <h3>{group}</h3>
            {SHORTCUTS.filter((action) => action.group === group).map((action) => (
              <div key={action.label}>
                <dt>{action.label}</dt>
                <dd>
                  {action.keys.map((key) => (
                    <kbd key={key}>{keyName(key)}</kbd>
                  ))}
                </dd>
              </div>
            ))}
          </dl>
        ))}
        <dl>
          <h3>When focused</h3>
          {FOCUS_KEYS.map(([label, keys]) => (
            <div key={label}>
              <dt>{label}</dt>
              <dd>
                {keys.map((key) => (
                  <kbd key={key}>{key}</kbd>
                ))}
              </dd>
            </div>
          ))}
        </dl>
      </div>
    </div>
  );
}
