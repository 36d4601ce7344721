import { render } from "preact";
import { initializeUser } from "./account/account";
import { Login } from "./account/Login";
import { history } from "../edit/history";
import { resumeRendering } from "../panels/looks/renderJob";
import { openShare } from "../panels/looks/shareLink";
import { trackThumbnails } from "../panels/looks/thumbnails";
import { openScene } from "../session/scene/openScene";
import { trackUrl } from "../session/scene/persistence";
import { parseUrl } from "../session/scene/url";
import { StartPage } from "../start/StartPage";
import { trackNetwork } from "../session/connections";
import { trackToneMap } from "../session/colorTransforms";
import { trackPanels } from "../state/panels";
import { trackTimeline } from "../panels/looks/keyframes";
import { trackPanelWidths } from "../state/panelWidths";
import { sessionUser } from "../state/sessionUser";
import { page } from "../state/scene";
import { contextPrototype } from "../render/color/canvasColor";
import { watchCanvasAbilities } from "../state/canvasColor";
import { trackName } from "../state/collaboration";
import { loadComparison } from "../panels/compare/comparison";
import { trackFocus } from "../ui/restoreFocus";
import { Toasts } from "../ui/toasts";
import { Editor } from "./Editor";
import "../ui/base.css";
import "../ui/controls.css";
import "../panels/scene/scenePanel.css";
import "../viewport/viewport.css";
import "../panels/inspector/inspector.css";
import "../panels/looks/looks.css";
import "../start/start.css";
import "../start/bake.css";
import "../curve/curve.css";
import "../panels/library/library.css";
import "../panels/lights/lights.css";
import "../panels/timeline/timeline.css";
import "../panels/compare/comparison.css";
import "./account/account.css";
import "../panels/collaboration/collaboration.css";
import "../panels/collaboration/comments.css";
import "./layout.css";
import "./bars.css";
import "../ui/responsive.css"; // after the styles that it overrides

function App() {
  const isLoggedIn = sessionUser.value.role !== "anyone";
  const inEditor = isLoggedIn && page.value === "editor"; // the editor shows messages itself
  return (
    <>
      {inEditor ? <Editor /> : isLoggedIn && <StartPage />}
      {!inEditor && <Toasts />}
      <Login />
    </>
  );
}

async function startApp(): Promise<void> {
  const isLoggedIn = await initializeUser().catch(() => true); // if the server is unreachable, other requests report it
  if (isLoggedIn) initialize();
  render(<App />, document.getElementById("app") as HTMLElement);
}

function initialize(): void {
  watchCanvasAbilities(contextPrototype, (query) => matchMedia(query));
  const urlState = parseUrl(location.search, location.hash);
  trackFocus();
  trackNetwork();
  trackName();
  if (urlState.share !== null) void openShare(urlState.share, urlState);
  else if (urlState.scene !== null) void openScene(urlState.scene, urlState);
  trackUrl();
  trackPanels();
  trackTimeline();
  trackPanelWidths();
  trackToneMap();
  trackThumbnails();
  void resumeRendering();
  void loadComparison(urlState.bake);
  // one drag is one step, even if it pauses; after the pointer leaves the control, the next drag is another step
  window.addEventListener("pointermove", (event) => event.buttons !== 0 && history.extendGesture(), { capture: true });
  for (const event of ["pointerup", "pointercancel"]) window.addEventListener(event, () => history.endGesture());
  window.addEventListener("popstate", () => location.reload());
}

void startApp();
