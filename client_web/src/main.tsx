import { render } from "preact";
import { Editor } from "./ui/Editor";
import { StartPage } from "./start/StartPage";
import { openShare } from "./looks/share";
import { openScene } from "./state/open";
import { followPanels } from "./state/panels";
import { followPlace } from "./state/place";
import { followRoom } from "./state/room";
import { history, page } from "./state/store";
import { placeFromUrl } from "./state/url";
import { Toasts } from "./ui/toasts";
import "./ui/base.css";
import "./ui/controls.css";
import "./ui/layout.css";
import "./ui/bars.css";
import "./outline/outline.css";
import "./picture/picture.css";
import "./inspector/inspector.css";
import "./looks/looks.css";
import "./start/start.css";
import "./start/bake.css";
import "./curve/curve.css";
import "./library/library.css";
import "./lights/lights.css";
import "./truth/truth.css";

function App() {
  return (
    <>
      {page.value === "editor" ? <Editor /> : <StartPage />}
      <Toasts />
    </>
  );
}

function start(): void {
  const place = placeFromUrl(location.search);
  const shared = new URLSearchParams(location.search).get("share");
  if (shared !== null) void openShare(shared);
  else if (place.scene !== null) void openScene(place.scene, place);
  followPlace();
  followPanels();
  followRoom();
  // one drag is one step, however long it rests on the way; once the hand has left the control, the next is another
  window.addEventListener("pointermove", (event) => event.buttons !== 0 && history.hold(), { capture: true });
  for (const event of ["pointerup", "pointercancel"]) window.addEventListener(event, () => history.seal());
  window.addEventListener("popstate", () => location.reload());
  render(<App />, document.getElementById("app") as HTMLElement);
}

start();
