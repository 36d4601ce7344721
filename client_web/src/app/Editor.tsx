/** The editor's layout. Everything but the image collapses. */
import { ReadOnly } from "./account/Account";
import { CommentsPanel } from "../panels/collaboration/CommentsPanel";
import { Inspector } from "../panels/inspector/Inspector";
import { LibraryPanel } from "../panels/library/LibraryPanel";
import { Filmstrip } from "../panels/looks/Filmstrip";
import { ScenePanel } from "../panels/scene/ScenePanel";
import { useFileDrop } from "../start/useFileDrop";
import { filmstripOpen, helpOpen, timelineOpen } from "../state/panels";
import { mayEdit } from "../state/sessionUser";
import { inspectorShownWidth, panelWidths, shownPanels, type SidePanel } from "../state/panelWidths";
import { Timeline } from "../panels/timeline/Timeline";
import { ComparisonPanel } from "../panels/compare/ComparisonPanel";
import { Splitter } from "../ui/Splitter";
import { Viewport } from "../viewport/Viewport";
import { Help } from "./Help";
import { StatusBar } from "./StatusBar";
import { TopBar } from "./TopBar";
import { DropHint } from "./DropHint";
import { handleDrop } from "./handleDrop";
import { useKeyboard } from "./keyboard";

export function Editor() {
  useKeyboard();
  const { outline, library, comparison, comments } = panelWidths.value;
  const widths = { outline, library, comparison, comments, inspector: inspectorShownWidth.value };
  const style = Object.fromEntries(Object.entries(widths).map(([name, width]) => [`--${name}`, `${width}px`]));
  const isPanelShown = (name: SidePanel) => shownPanels.value.includes(name);
  const isDropTarget = useFileDrop(handleDrop);
  return (
    <div class={`editor ${isDropTarget ? "over" : ""}`} style={style}>
      <TopBar />
      <div class="middle">
        {isPanelShown("outline") && <ScenePanel />}
        <Viewport />
        {isDropTarget && <DropHint />}
        {isPanelShown("library") && mayEdit.value && <LibraryPanel />}
        {isPanelShown("comparison") && <ComparisonPanel />}
        {isPanelShown("comments") && <CommentsPanel />}
        {isPanelShown("inspector") && (
          <aside class="side" aria-label="Inspector">
            <Splitter />
            <div class="inspected">
              <ReadOnly />
              <div inert={!mayEdit.value}>
                <Inspector />
              </div>
            </div>
          </aside>
        )}
      </div>
      {timelineOpen.value && mayEdit.value && <Timeline />}
      {filmstripOpen.value && <Filmstrip />}
      <StatusBar />
      {helpOpen.value && <Help />}
    </div>
  );
}
