/** Reading a finished image back without making the browser wait for the GPU. */
type Gl = WebGL2RenderingContext;

const POLL_MS = 2;

async function waitForFence(gl: Gl): Promise<void> {
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  if (fence === null) return;
  gl.flush();
  while (!gl.isContextLost() && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) {
    await new Promise((done) => setTimeout(done, POLL_MS));
  }
  gl.deleteSync(fence);
}

/** Read the pixels of some framebuffer attachments, four bytes each; resolves when they are available. */
export async function readPixels(
  gl: Gl,
  framebuffer: WebGLFramebuffer,
  attachments: number,
  width: number,
  height: number,
): Promise<Uint8Array[]> {
  const size = 4 * width * height;
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, framebuffer);
  const buffers = Array.from({ length: attachments }, (_, index) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, size, gl.STREAM_READ);
    gl.readBuffer(gl.COLOR_ATTACHMENT0 + index);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
    return buffer;
  });
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
  await waitForFence(gl);
  return buffers.map((buffer) => {
    const bytes = new Uint8Array(size);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, bytes);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    gl.deleteBuffer(buffer);
    return bytes;
  });
}
