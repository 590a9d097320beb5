.syntax unified
.thumb
.cpu cortex-m3
main: cpsid i
 ldr r0,=0xE000E200
 ldr r1,=0x30000000
 str r1,[r0]
 ldr r4,=0x40010810
 movs r2,#1
 str r2,[r4]
 cpsie i
sleep: wfi
 b sleep
.org 0x20
h28: movs r2,#2
 str r2,[r4]
 ldr r0,=0xE000E200
 ldr r1,=0x40000000
 str r1,[r0]
 nop
 b 1f
1: lsls r2,r2,#16
 str r2,[r4]
 bx lr
.org 0x40
h29: movs r2,#4
 str r2,[r4]
 lsls r2,r2,#16
 str r2,[r4]
 bx lr
.org 0x50
h30: movs r2,#8
 str r2,[r4]
 lsls r2,r2,#16
 str r2,[r4]
 bx lr
.org 0x60
svcs: svc 7
 movs r5,#1
 b sleep
.org 0x70
wild: ldr r0,=0x60000000
 ldr r1,[r0]
 b sleep
.pool
