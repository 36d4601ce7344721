/** REST calls; failures become ApiError with the server's message (RFC 9457). */
import type {
  AlbedoBody,
  BakeBody,
  BakeRequest,
  ExampleSceneBody,
  ColorBody,
  CommentBody,
  CommentRequest,
  DryRunBody,
  EnvironmentBody,
  IesBody,
  ImageBody,
  ZernikeFitBody,
  ZernikeFitRequest,
  Look,
  LooksBody,
  LutBody,
  LooksRequest,
  MaterialBody,
  MaterialMapBody,
  BtfBody,
  BtfJobBody,
  ImportedBody,
  MeasuredBody,
  MetalnessBody,
  MixedLookBody,
  ModelBody,
  OcioView,
  Problem,
  PrincipledBody,
  PrincipledRequest,
  PrincipledTermsBody,
  PrincipledTermsRequest,
  RenderBody,
  RenderPlanBody,
  RenderRequest,
  SceneBody,
  ShareBody,
  ShareEntry,
  ShareRequest,
  SolveBody,
  SolveRequest,
  SyntheticBtfRequest,
  Term,
  ComparisonBody,
  ComparisonPlanBody,
  ComparisonRequest,
} from "../../protocol";
import { serverUrl } from "./serverUrl";

export class ApiError extends Error {
  constructor(
    message: string,
    readonly status: number,
  ) {
    super(message);
  }
}

/** The server did not respond. */
export class UnreachableError extends ApiError {
  constructor() {
    super("Can't reach the server. Nothing is lost. Try again when the connection is back.", 0);
  }
}

/** A problem document as one sentence. */
export function problemText(
  problem: Partial<Problem> | string | null | undefined,
  fallback = "The server could not complete this request.",
): string {
  if (problem == null) return fallback;
  if (typeof problem === "string") return problem;
  return problem.detail ?? problem.title ?? fallback;
}

async function errorFromResponse(response: Response): Promise<ApiError> {
  const fallback = `Server error ${response.status} ${response.statusText}.`;
  const problem = (await response.json().catch(() => null)) as Partial<Problem> | null;
  const detail = typeof problem?.detail === "string" ? problem.detail : problem?.title;
  return new ApiError(detail ?? fallback, response.status);
}

let unauthorizedListener: (message: string) => void = () => undefined;

/** Listener for a server that asks for a login. */
export function onUnauthorized(callback: typeof unauthorizedListener): void {
  unauthorizedListener = callback;
}

export async function request(path: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(serverUrl(path), init);
  } catch {
    throw new UnreachableError();
  }
  if (response.ok) return response;
  const error = await errorFromResponse(response);
  if (error.status === 401) unauthorizedListener(error.message);
  throw error;
}

const UNAVAILABLE_STATUSES = [0, 502, 503, 504];

/** The response to a poll; null if the server is unreachable, also behind a proxy: its job continues when it is back. */
export async function nullIfUnavailable<T>(answer: Promise<T>): Promise<T | null> {
  return answer.catch((error: unknown) => {
    if (error instanceof ApiError && UNAVAILABLE_STATUSES.includes(error.status)) return null;
    throw error;
  });
}

export function json(method: string, body: unknown, headers: Record<string, string> = {}): RequestInit {
  return { method, headers: { "content-type": "application/json", ...headers }, body: JSON.stringify(body) };
}

export async function getJson<T>(path: string): Promise<T> {
  return (await (await request(path)).json()) as T;
}

export const listScenes = () => getJson<SceneBody[]>("/api/scenes");
export const getScene = (id: string) => getJson<SceneBody>(`/api/scenes/${encodeURIComponent(id)}`);
export const listBuiltIns = () => getJson<ExampleSceneBody[]>("/api/example-scenes");
/** Create a built-in scene; repeated calls return the same one. */
export async function createBuiltInScene(name: string): Promise<SceneBody> {
  return (await (
    await request(`/api/example-scenes/${encodeURIComponent(name)}`, { method: "POST" })
  ).json()) as SceneBody;
}
export const listModels = () => getJson<ModelBody[]>("/api/models");
export const listMaterials = () => getJson<MaterialBody[]>("/api/materials");
export const listBtfs = () => getJson<BtfBody[]>("/api/materials/btf");
export const getBtf = (id: string) => getJson<BtfBody>(`/api/materials/btf/${encodeURIComponent(id)}`);
const btfJobPath = (id: string) => `/api/materials/btf/jobs/${encodeURIComponent(id)}`;
export const listBtfJobs = () => getJson<BtfJobBody[]>("/api/materials/btf/jobs");
export async function startBtfJob(body: SyntheticBtfRequest): Promise<BtfJobBody> {
  return (await (await request("/api/materials/btf/jobs/synthetic", json("POST", body))).json()) as BtfJobBody;
}
/** Stop a job; its results so far remain. */
export async function stopBtfJob(id: string): Promise<void> {
  await request(btfJobPath(id), { method: "DELETE" });
}
export async function resumeBtfJob(id: string): Promise<void> {
  await request(`${btfJobPath(id)}/resume`, { method: "POST" });
}
export async function deleteBtfJob(id: string): Promise<void> {
  await request(`${btfJobPath(id)}?delete_files=true`, { method: "DELETE" });
}
export const listImported = () => getJson<ImportedBody[]>("/api/materials/imported");
export const listMeasured = () => getJson<MeasuredBody[]>("/api/materials/measured");
/** Table of fits that a material map shows: Ngan 2005, as in Sun 2007, or Löw 2012. */
export type MapTable = "ngan" | "low";
export const getMaterialMap = (table: MapTable) => getJson<MaterialMapBody>(`/api/materials/map?table=${table}`);
export const getMaterialAt = (f0: number, sigma: number, table: MapTable) =>
  getJson<Term[]>(`/api/materials/map/at?f0=${f0}&sigma=${sigma}&table=${table}`);
/** Thumbnail of a library material with id "table/material". */
export const materialThumbnailUrl = (id: string) =>
  `/api/materials/${id.split("/").map(encodeURIComponent).join("/")}/thumbnail.png`;
/** Thumbnail of a measured material, by its reference in looks: "btf:id", "merl:id". */
export const measuredThumbnailUrl = (data: string) => {
  const [kind, id = ""] = data.split(":");
  return `/api/materials/${kind === "btf" ? "btf" : "measured"}/${encodeURIComponent(id)}/thumbnail.png`;
};
export const listEnvironments = () => getJson<EnvironmentBody[]>("/api/environments");
export async function deleteEnvironment(id: string): Promise<void> {
  await request(`/api/environments/${encodeURIComponent(id)}`, { method: "DELETE" });
}
export const getColor = () => getJson<ColorBody>("/api/color");
/** A view of an OpenColorIO config as a table. */
export async function getLut(config: string, { display, view }: OcioView): Promise<ArrayBuffer> {
  const query = new URLSearchParams({ display, view });
  return (await request(`/api/color/${encodeURIComponent(config)}/lut?${query}`)).arrayBuffer();
}
/** Display LUTs. */
export const listLuts = () => getJson<LutBody[]>("/api/luts");
const lutPath = (name: string) => `/api/luts/${encodeURIComponent(name.replace(/^lut:/, ""))}`;
export const getLutTable = async (name: string): Promise<ArrayBuffer> =>
  (await request(`${lutPath(name)}/table`)).arrayBuffer();
export async function deleteLut(name: string): Promise<void> {
  await request(lutPath(name), { method: "DELETE" });
}
export const listIes = () => getJson<IesBody[]>("/api/ies");
export async function deleteIes(id: string): Promise<void> {
  await request(`/api/ies/${encodeURIComponent(id)}`, { method: "DELETE" });
}
export const listImages = () => getJson<ImageBody[]>("/api/images");
export async function deleteImage(id: string): Promise<void> {
  await request(`/api/images/${encodeURIComponent(id)}`, { method: "DELETE" });
}
/** A material's terms with a metalness map. */
export async function addMetalness(
  image: string,
  scene: string,
  material: string,
  terms: readonly Term[],
): Promise<Term[]> {
  const path = `/api/images/${encodeURIComponent(image)}/metalness`;
  return ((await (await request(path, json("POST", { scene, material, terms }))).json()) as MetalnessBody).terms;
}
/** Preview ball of a material with these terms and their textures. */
export async function renderMaterialBall(scene: string, material: string, terms: readonly Term[]): Promise<Blob> {
  const path = `/api/scenes/${encodeURIComponent(scene)}/ball`;
  return (await request(path, json("POST", { material, terms }))).blob();
}
/** Thumbnail of a bake's original environment. */
export const bakedEnvironmentThumbnailUrl = (bake: string) => `/api/bakes/${encodeURIComponent(bake)}/environment.png`;
export const getBake = (id: string) => getJson<BakeBody>(`/api/bakes/${encodeURIComponent(id)}`);

export const listBakes = (scene: string) => getJson<BakeBody[]>(`/api/bakes?scene=${encodeURIComponent(scene)}`);

export async function deleteScene(id: string): Promise<void> {
  await request(`/api/scenes/${encodeURIComponent(id)}`, { method: "DELETE" });
}

/** Clay picture of a camera, by default the first; its height follows from the width and the camera. */
export function clayUrl(scene: string, width: number, camera?: { name: string; height: number }): string {
  const query = camera === undefined ? "" : `&camera=${encodeURIComponent(camera.name)}&height=${camera.height}`;
  return `/api/scenes/${encodeURIComponent(scene)}/clay.png?width=${width}${query}`;
}

/** Create a copy of a scene with a ground plane. */
export async function addGround(id: string): Promise<SceneBody> {
  return (await (
    await request(`/api/scenes/${encodeURIComponent(id)}/ground`, { method: "POST" })
  ).json()) as SceneBody;
}

export async function planBake(body: BakeRequest): Promise<DryRunBody> {
  return (await (await request("/api/bakes", json("POST", { ...body, dry_run: true }))).json()) as DryRunBody;
}

export async function startBake(body: BakeRequest): Promise<BakeBody> {
  return (await (await request("/api/bakes", json("POST", body))).json()) as BakeBody;
}

/** Cancel a bake; ignored if it has just ended. */
export async function cancelBake(id: string): Promise<void> {
  await request(`/api/bakes/${encodeURIComponent(id)}`, { method: "DELETE" }).catch((error: unknown) => {
    if (!(error instanceof ApiError && error.status === 409)) throw error;
  });
}

/** Directional albedo of a material with these terms. */
export async function getAlbedo(terms: Term[]): Promise<AlbedoBody> {
  return (await (await request("/api/models/albedo", json("POST", { terms }))).json()) as AlbedoBody;
}

/** How free-camera views draw each term of a material in the Zernike basis. */
export async function getZernikeFit(body: ZernikeFitRequest): Promise<ZernikeFitBody[]> {
  return (await (await request("/api/models/zernike-fit", json("POST", body))).json()) as ZernikeFitBody[];
}

/** Principled parameters of a material, or those of the closest principled one. */
export async function readPrincipled(body: PrincipledRequest): Promise<PrincipledBody> {
  return (await (await request("/api/models/principled", json("POST", body))).json()) as PrincipledBody;
}

/** Terms and glass of principled parameters. */
export async function makePrincipledTerms(body: PrincipledTermsRequest): Promise<PrincipledTermsBody> {
  return (await (await request("/api/models/principled/terms", json("POST", body))).json()) as PrincipledTermsBody;
}

export async function startRender(body: RenderRequest): Promise<RenderBody> {
  return (await (await request("/api/renders", json("POST", body))).json()) as RenderBody;
}
/** Names, cost and warnings of a render; nothing is queued. */
export async function planRender(body: RenderRequest): Promise<RenderPlanBody> {
  return (await (await request("/api/renders", json("POST", { ...body, dry_run: true }))).json()) as RenderPlanBody;
}
/** The complete look of each frame of an animation. */
export async function interpolateLooks(body: LooksRequest): Promise<LooksBody> {
  return (await (await request("/api/renders/looks", json("POST", body))).json()) as LooksBody;
}
/** A look with the lights of a light mix. */
export async function mixLook(bake: string, look: Look, mix: Record<string, unknown>): Promise<MixedLookBody> {
  const path = `/api/bakes/${encodeURIComponent(bake)}/light-mix`;
  return (await (await request(path, json("POST", { look, mix }))).json()) as MixedLookBody;
}
export async function deleteRender(id: string): Promise<void> {
  await request(`/api/renders/${encodeURIComponent(id)}`, { method: "DELETE" });
}
export const getRender = (id: string) => getJson<RenderBody>(`/api/renders/${encodeURIComponent(id)}`);

export async function createShare(body: ShareRequest): Promise<ShareEntry> {
  return (await (await request("/api/shares", json("POST", body))).json()) as ShareEntry;
}
export const getShare = (id: string) => getJson<ShareBody>(`/api/shares/${encodeURIComponent(id)}`);

/** Lights from strokes over an image, or from a reference picture. */
export async function solveLook(body: SolveRequest): Promise<SolveBody> {
  return (await (await request("/api/solve", json("POST", body))).json()) as SolveBody;
}

export type ComparisonImage = "error" | "reference" | "method-error" | "method-reference";

const commentsPath = (scene: string) => `/api/scenes/${encodeURIComponent(scene)}/comments`;
const commentPath = (scene: string, id: string) => `${commentsPath(scene)}/${encodeURIComponent(id)}`;

export const listComments = (scene: string) => getJson<CommentBody[]>(commentsPath(scene));
export async function addComment(scene: string, body: CommentRequest): Promise<CommentBody> {
  return (await (await request(commentsPath(scene), json("POST", body))).json()) as CommentBody;
}
export async function setResolved(scene: string, id: string, resolved: boolean): Promise<void> {
  await request(commentPath(scene, id), json("PATCH", { resolved }));
}
export async function deleteComment(scene: string, id: string): Promise<void> {
  await request(commentPath(scene, id), { method: "DELETE" });
}

const comparisonPath = (id: string) => `/api/comparisons/${encodeURIComponent(id)}`;

export async function startComparison(body: ComparisonRequest): Promise<ComparisonBody> {
  return (await (await request("/api/comparisons", json("POST", body))).json()) as ComparisonBody;
}
export const getComparison = (id: string) => getJson<ComparisonBody>(comparisonPath(id));
/** Estimated cost of a comparison, without starting it. */
export async function planComparison(body: ComparisonRequest): Promise<ComparisonPlanBody> {
  return (await (
    await request("/api/comparisons", json("POST", { ...body, dry_run: true }))
  ).json()) as ComparisonPlanBody;
}
/** Stop a comparison; its passes so far remain. */
export async function stopComparison(id: string): Promise<void> {
  await request(comparisonPath(id), { method: "DELETE" });
}
export async function resumeComparison(id: string): Promise<ComparisonBody> {
  return (await (await request(`${comparisonPath(id)}/resume`, { method: "POST" })).json()) as ComparisonBody;
}
export async function deleteComparison(id: string): Promise<void> {
  await request(`${comparisonPath(id)}?delete_files=true`, { method: "DELETE" });
}
/** URL of a comparison's image after a number of passes. */
export const comparisonImageUrl = (id: string, name: ComparisonImage, passes: number) =>
  `${comparisonPath(id)}/${name}.png?passes=${passes}`;
