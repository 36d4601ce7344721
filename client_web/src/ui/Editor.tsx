/** The editor's layout: what stands where. Everything but the picture collapses. */
import { Filmstrip } from "../looks/Filmstrip";
import { LibraryPanel } from "../library/LibraryPanel";
import { libraryOpen } from "../library/library";
import { Inspector } from "../inspector/Inspector";
import { Outline } from "../outline/Outline";
import { take } from "../outline/environments";
import { PictureView } from "../picture/PictureView";
import { filmstripOpen, inspectorOpen, inspectorWidth, outlineOpen } from "../state/panels";
import { helpOpen } from "../state/store";
import { TruthPanel } from "../truth/TruthPanel";
import { truthOpen } from "../truth/truth";
import { Help } from "./Help";
import { Splitter } from "./Splitter";
import { StatusBar } from "./StatusBar";
import { TopBar } from "./TopBar";
import { useFileDrop } from "./useFileDrop";
import { useKeyboard } from "./keyboard";

export function Editor() {
  useKeyboard();
  const over = useFileDrop((files) => void take(files));
  return (
    <div class={`editor ${over ? "over" : ""}`} style={{ "--inspector": `${inspectorWidth.value}px` }}>
      <TopBar />
      <div class="middle">
        {outlineOpen.value && <Outline />}
        <PictureView />
        {libraryOpen.value && <LibraryPanel />}
        {truthOpen.value && <TruthPanel />}
        {inspectorOpen.value && <Splitter />}
        {inspectorOpen.value && <Inspector />}
      </div>
      {filmstripOpen.value && <Filmstrip />}
      <StatusBar />
      {helpOpen.value && <Help />}
    </div>
  );
}
