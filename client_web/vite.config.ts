import { defineConfig } from "vite";

export default defineConfig({
  base: "./",
  build: { outDir: "dist", assetsDir: "assets", target: "es2022", reportCompressedSize: true },
  server: { proxy: { "/api": { target: "http://127.0.0.1:8420", ws: true } } },
});
