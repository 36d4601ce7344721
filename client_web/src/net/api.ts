/** REST calls; failures become ApiError with the server's own words (RFC 9457). */
import type {
  AlbedoBody,
  BakeBody,
  BakeRequest,
  BuiltInBody,
  ColorBody,
  CommentBody,
  CommentRequest,
  DryRunBody,
  EnvironmentBody,
  ImageBody,
  InOutBody,
  LooksBody,
  LooksRequest,
  MaterialBody,
  MaterialMapBody,
  BtfBody,
  BtfWorkBody,
  MeasuredBody,
  MetalnessBody,
  ModelBody,
  OcioView,
  Problem,
  RenderBody,
  RenderRequest,
  SceneBody,
  ShareBody,
  ShareEntry,
  ShareRequest,
  SyntheticBtfRequest,
  Term,
  TruthBody,
  TruthPlanBody,
  TruthRequest,
} from "../protocol";

export class ApiError extends Error {
  constructor(
    message: string,
    readonly status: number,
  ) {
    super(message);
  }
}

/** Nobody answered. */
export class UnansweredError extends ApiError {
  constructor() {
    super("The server cannot be reached. Nothing was lost; try again when it is back.", 0);
  }
}

/** What a problem document says, in one sentence. */
export function problemText(
  problem: Problem | string | null | undefined,
  fallback = "The server could not do that.",
): string {
  if (problem == null) return fallback;
  if (typeof problem === "string") return problem;
  return problem.detail ?? problem.title ?? fallback;
}

async function failure(response: Response): Promise<ApiError> {
  const fallback = `The server answered ${response.status} ${response.statusText}.`;
  const problem = (await response.json().catch(() => null)) as Problem | null;
  const detail = typeof problem?.detail === "string" ? problem.detail : problem?.title;
  return new ApiError(detail ?? fallback, response.status);
}

let refused: (words: string) => void = () => undefined;

/** Who is told that the server asks for a login. */
export function whenRefused(take: typeof refused): void {
  refused = take;
}

export async function request(path: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, init);
  } catch {
    throw new UnansweredError();
  }
  if (response.ok) return response;
  const error = await failure(response);
  if (error.status === 401) refused(error.message);
  throw error;
}

const AWAY = [0, 502, 503, 504];

/** What the server answers; null where it is away, or a proxy says so: it goes on with its work when it is back. */
export async function unlessAway<T>(answer: Promise<T>): Promise<T | null> {
  return answer.catch((error: unknown) => {
    if (error instanceof ApiError && AWAY.includes(error.status)) return null;
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
export const listBuiltIns = () => getJson<BuiltInBody[]>("/api/built-ins");
/** Make a built-in scene; a second time it is the same one. */
export async function takeBuiltIn(name: string): Promise<SceneBody> {
  return (await (await request(`/api/built-ins/${encodeURIComponent(name)}`, { method: "POST" })).json()) as SceneBody;
}
export const listModels = () => getJson<ModelBody[]>("/api/models");
export const listMaterials = () => getJson<MaterialBody[]>("/api/materials");
export const listBtfs = () => getJson<BtfBody[]>("/api/materials/btf");
export const getBtf = (id: string) => getJson<BtfBody>(`/api/materials/btf/${encodeURIComponent(id)}`);
const btfWork = (id: string) => `/api/materials/btf-works/${encodeURIComponent(id)}`;
export const listBtfWorks = () => getJson<BtfWorkBody[]>("/api/materials/btf-works");
export async function startBtf(body: SyntheticBtfRequest): Promise<BtfWorkBody> {
  return (await (await request("/api/materials/btf-works/synthetic", json("POST", body))).json()) as BtfWorkBody;
}
/** What was found so far is kept. */
export async function stopBtfWork(id: string): Promise<void> {
  await request(btfWork(id), { method: "DELETE" });
}
export async function resumeBtfWork(id: string): Promise<void> {
  await request(`${btfWork(id)}/resume`, { method: "POST" });
}
export async function forgetBtfWork(id: string): Promise<void> {
  await request(`${btfWork(id)}?forget=true`, { method: "DELETE" });
}
export const listMeasured = () => getJson<MeasuredBody[]>("/api/materials/measured");
export const getMaterialMap = () => getJson<MaterialMapBody>("/api/materials/map");
export const materialAt = (f0: number, sigma: number) => getJson<Term[]>(`/api/materials/map/at?f0=${f0}&sigma=${sigma}`);
/** Of a library material, whose id is "table/material". */
export const materialThumbnail = (id: string) =>
  `/api/materials/${id.split("/").map(encodeURIComponent).join("/")}/thumbnail.png`;
/** Of what was measured, by its name in looks: "btf:id", "merl:id". */
export const measuredThumbnail = (data: string) => {
  const [kind, id = ""] = data.split(":");
  return `/api/materials/${kind === "btf" ? "btf" : "measured"}/${encodeURIComponent(id)}/thumbnail.png`;
};
export const listEnvironments = () => getJson<EnvironmentBody[]>("/api/environments");
export async function deleteEnvironment(id: string): Promise<void> {
  await request(`/api/environments/${encodeURIComponent(id)}`, { method: "DELETE" });
}
export const getColor = () => getJson<ColorBody>("/api/color");
/** A view of a config as a table. */
export async function getLut(config: string, { display, view }: OcioView): Promise<ArrayBuffer> {
  const of = new URLSearchParams({ display, view });
  return (await request(`/api/color/${encodeURIComponent(config)}/lut?${of}`)).arrayBuffer();
}
export const listImages = () => getJson<ImageBody[]>("/api/images");
export async function deleteImage(id: string): Promise<void> {
  await request(`/api/images/${encodeURIComponent(id)}`, { method: "DELETE" });
}
/** What a material's terms become where an image says that it is metal. */
export async function withMetalness(image: string, scene: string, material: string, terms: readonly Term[]): Promise<Term[]> {
  const path = `/api/images/${encodeURIComponent(image)}/metalness`;
  return ((await (await request(path, json("POST", { scene, material, terms }))).json()) as MetalnessBody).terms;
}
/** A ball of a material with these terms, in their images. */
export async function ballOf(scene: string, material: string, terms: readonly Term[]): Promise<Blob> {
  const path = `/api/scenes/${encodeURIComponent(scene)}/ball`;
  return (await request(path, json("POST", { material, terms }))).blob();
}
/** The light that a bake's scene came with. */
export const ownEnvironmentThumbnail = (bake: string) => `/api/bakes/${encodeURIComponent(bake)}/environment.png`;
export const getBake = (id: string) => getJson<BakeBody>(`/api/bakes/${encodeURIComponent(id)}`);

export const bakesOfScene = (scene: string) => getJson<BakeBody[]>(`/api/bakes?scene=${encodeURIComponent(scene)}`);

export async function deleteScene(id: string): Promise<void> {
  await request(`/api/scenes/${encodeURIComponent(id)}`, { method: "DELETE" });
}

/** The same scene on a ground, as a new one. */
export async function addGround(id: string): Promise<SceneBody> {
  return (await (await request(`/api/scenes/${encodeURIComponent(id)}/ground`, { method: "POST" })).json()) as SceneBody;
}

export async function planBake(body: BakeRequest): Promise<DryRunBody> {
  return (await (await request("/api/bakes", json("POST", { ...body, dry_run: true }))).json()) as DryRunBody;
}

export async function startBake(body: BakeRequest): Promise<BakeBody> {
  return (await (await request("/api/bakes", json("POST", body))).json()) as BakeBody;
}

/** Cancel a bake; one that has ended a moment before needs it no more. */
export async function cancelBake(id: string): Promise<void> {
  await request(`/api/bakes/${encodeURIComponent(id)}`, { method: "DELETE" }).catch((error: unknown) => {
    if (!(error instanceof ApiError && error.status === 409)) throw error;
  });
}

/** What share of light a material of these terms sends back. */
export async function getAlbedo(terms: Term[]): Promise<AlbedoBody> {
  return (await (await request("/api/models/albedo", json("POST", { terms }))).json()) as AlbedoBody;
}

/** How terms are sent in views whose eye moves. */
export async function getInOut(terms: Term[]): Promise<InOutBody[]> {
  return (await (await request("/api/models/in-out", json("POST", { terms }))).json()) as InOutBody[];
}

export async function startRender(body: RenderRequest): Promise<RenderBody> {
  return (await (await request("/api/renders", json("POST", body))).json()) as RenderBody;
}
/** The complete look of each frame of an animation. */
export async function frameLooks(body: LooksRequest): Promise<LooksBody> {
  return (await (await request("/api/renders/looks", json("POST", body))).json()) as LooksBody;
}
export async function deleteRender(id: string): Promise<void> {
  await request(`/api/renders/${encodeURIComponent(id)}`, { method: "DELETE" });
}
export const getRender = (id: string) => getJson<RenderBody>(`/api/renders/${encodeURIComponent(id)}`);

export async function makeShare(body: ShareRequest): Promise<ShareEntry> {
  return (await (await request("/api/shares", json("POST", body))).json()) as ShareEntry;
}
export const getShare = (id: string) => getJson<ShareBody>(`/api/shares/${encodeURIComponent(id)}`);

export type TruthPicture = "error" | "reference" | "method-error" | "method-reference";

const commentsPath = (scene: string) => `/api/scenes/${encodeURIComponent(scene)}/comments`;
const commentPath = (scene: string, id: string) => `${commentsPath(scene)}/${encodeURIComponent(id)}`;

export const listComments = (scene: string) => getJson<CommentBody[]>(commentsPath(scene));
export async function addComment(scene: string, body: CommentRequest): Promise<CommentBody> {
  return (await (await request(commentsPath(scene), json("POST", body))).json()) as CommentBody;
}
export async function settleComment(scene: string, id: string, resolved: boolean): Promise<void> {
  await request(commentPath(scene, id), json("PATCH", { resolved }));
}
export async function deleteComment(scene: string, id: string): Promise<void> {
  await request(commentPath(scene, id), { method: "DELETE" });
}

const truthPath = (id: string) => `/api/truths/${encodeURIComponent(id)}`;

export async function startTruth(body: TruthRequest): Promise<TruthBody> {
  return (await (await request("/api/truths", json("POST", body))).json()) as TruthBody;
}
export const getTruth = (id: string) => getJson<TruthBody>(truthPath(id));
/** How long a comparison would take; nothing is begun. */
export async function planTruth(body: TruthRequest): Promise<TruthPlanBody> {
  return (await (await request("/api/truths", json("POST", { ...body, dry_run: true }))).json()) as TruthPlanBody;
}
/** Its passes so far are kept. */
export async function stopTruth(id: string): Promise<void> {
  await request(truthPath(id), { method: "DELETE" });
}
export async function resumeTruth(id: string): Promise<TruthBody> {
  return (await (await request(`${truthPath(id)}/resume`, { method: "POST" })).json()) as TruthBody;
}
export async function forgetTruth(id: string): Promise<void> {
  await request(`${truthPath(id)}?forget=true`, { method: "DELETE" });
}
/** The address of a comparison's picture as it is after so many passes. */
export const truthPicture = (id: string, name: TruthPicture, passes: number) =>
  `${truthPath(id)}/${name}.png?passes=${passes}`;
